"""The pose filter against rendered pictures: the world's camera and the real detector make the blocks, not its model.

The true poses are those that the pictures were drawn from.
"""

import math

import numpy as np
import pytest

from robot_formation.alignment.precise.marker_edges import EdgeParameters, mean_boxes
from robot_formation.alignment.precise.marker_projection import GeometryParameters, MarkerModel, pose_of
from robot_formation.alignment.precise.pose_filter import FilterParameters, PoseFilter
from robot_formation.components.node_parameters import BlockDetectorNodeParameters, WorldNodeParameters
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import from_mapping
from robot_formation.surface import make_surface
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.world.camera import Camera
from robot_formation.world.pose import Pose, pose_on_surface
from robot_formation.world.sensor import Sensor

pytestmark = pytest.mark.slow

WORLD = from_mapping(WorldNodeParameters, node_defaults("world"), where="world")
DETECTOR = from_mapping(BlockDetectorNodeParameters, node_defaults("block_detector"), where="block_detector")
FRAMES, AVERAGED = 22, 10
FRAME_US = 33_333
NEIGHBOUR = Motion(0.9, 0.9, 0.7)


class Pair:
    """A neighbour that stands on a surface, a follower that is put down beside it, and the filter in question."""

    def __init__(self, surface: str) -> None:
        self.surface = make_surface(surface)
        self.camera = Camera(self.surface, WORLD)
        self.neighbour = self.on_ground(NEIGHBOUR)
        self.follower = self.neighbour
        self.filter = PoseFilter(MarkerModel(GeometryParameters()), EdgeParameters(), FilterParameters())
        self.looks = 0

    def on_ground(self, place: Motion) -> Pose:
        return pose_on_surface(self.surface, place.x_m, place.y_m, place.yaw_rad)

    def look_from(self, place: Motion) -> None:
        """Put the follower at a place in the neighbour's frame; let the filter know of the way there and of a look."""
        before, self.follower = self.follower, self.on_ground(NEIGHBOUR.then(place))
        if self.filter.known:
            self.filter.moved(self.follower.planar.relative_to(before.planar))
        self.filter.look(mean_boxes(self._frames()[-AVERAGED:]))
        self.looks += 1

    def _frames(self) -> list[list[Block]]:
        sensor = Sensor(WORLD.camera, self.looks, "follower_1")
        development = sensor.develop(self.camera.light(self.follower, [self.neighbour]))
        detector = BlockDetector(DETECTOR.load(), DETECTOR)
        return [detector.process(sensor.expose(development, 0.0), n * FRAME_US) for n in range(FRAMES)]

    def faces(self, yaw_rad: float) -> set[Face]:
        """The faces that a look shows of a neighbour straight beside the follower, and turned in its frame."""
        self.follower = self.on_ground(NEIGHBOUR.then(Motion(0.0, 0.32, yaw_rad).inverse()))
        return set(mean_boxes(self._frames()[-AVERAGED:]))

    def errors(self) -> tuple[float, float, float]:
        """Estimate minus truth: distance between the origins [m], bearing [rad], heading [rad]."""
        found, true = pose_of(self.filter.best.state), self.neighbour.planar.relative_to(self.follower.planar)
        distance_m = math.dist(self.neighbour.position, self.follower.position)
        bearing_rad = math.atan2(found.x_m, found.y_m) - math.atan2(true.x_m, true.y_m)
        return math.hypot(found.x_m, found.y_m) - distance_m, bearing_rad, found.yaw_rad - true.yaw_rad


@pytest.mark.parametrize("surface", ["plane", "bowl"])
def test_a_heading_of_less_than_10_degrees_shows_no_second_face(surface: str) -> None:
    pair = Pair(surface)
    for degrees in (-9, -5, 0, 5, 9):
        assert pair.faces(math.radians(degrees)) == {Face.TARGET}, degrees
    assert pair.faces(math.radians(30)) == {Face.TARGET, Face.REAR}
    assert pair.faces(math.radians(-30)) == {Face.TARGET, Face.FRONT}


@pytest.mark.parametrize("surface", ["plane", "bowl"])
def test_distance_and_bearing_follow_from_one_look(surface: str) -> None:
    for place in (Motion(0.0, -0.32), Motion(0.01, -0.35, 0.05), Motion(-0.015, -0.40, -0.04)):
        pair = Pair(surface)
        pair.look_from(place)
        distance_m, bearing_rad, _ = pair.errors()
        assert distance_m == pytest.approx(0.0, abs=0.012), place
        assert bearing_rad == pytest.approx(0.0, abs=0.02), place


# The filter expects a bowl: elsewhere the relative tilt, and with it the distance, is less certain.
@pytest.mark.parametrize(("surface", "most_m"), [("plane", 0.012), ("bowl", 0.005), ("saddle", 0.02)])
@pytest.mark.parametrize("yaw_rad", [-0.25, 0.0, 0.2])
def test_the_heading_follows_from_looks_behind_and_ahead(surface: str, most_m: float, yaw_rad: float) -> None:
    pair = Pair(surface)
    for ahead_m in (-0.01, 0.135, -0.135, 0.12, -0.12):
        pair.look_from(Motion(ahead_m, -0.33, yaw_rad))
    distance_m, bearing_rad, heading_rad = pair.errors()
    assert distance_m == pytest.approx(0.0, abs=most_m)
    assert bearing_rad == pytest.approx(0.0, abs=0.02)
    assert heading_rad == pytest.approx(0.0, abs=math.radians(3.5))


def test_a_neighbour_far_away_and_turned_is_found_from_three_looks() -> None:
    pair = Pair("bowl")
    for place in (Motion(-0.25, -0.60, -0.4), Motion(-0.15, -0.50, -0.3), Motion(-0.08, -0.42, -0.2)):
        pair.look_from(place)
    distance_m, bearing_rad, heading_rad = pair.errors()
    assert distance_m == pytest.approx(0.0, abs=0.012)
    assert bearing_rad == pytest.approx(0.0, abs=0.02)
    assert heading_rad == pytest.approx(0.0, abs=math.radians(4.0))


def test_the_estimates_own_scatter_is_not_much_less_than_its_errors() -> None:
    sigmas = []
    for number in range(6):
        pair = Pair("bowl")
        for ahead_m in (0.02 * number - 0.05, 0.135, -0.135):
            pair.look_from(Motion(ahead_m, -0.33 - 0.004 * number, 0.03 * number - 0.08))
        sigmas.append(pair.errors()[2] / pair.filter.yaw_sigma_rad)
    assert float(np.sqrt(np.mean(np.square(sigmas)))) < 2.0
