"""The picture from above: exact projection, dots to a part of a pixel, no memory, noise of its own."""

import math

import numpy as np
import numpy.typing as npt
import pytest

from robot_formation.experiment.scenario import load_track
from robot_formation.parameters import to_mapping
from robot_formation.surface import Surface, make_surface
from robot_formation.vision.overhead.dots import find_dots
from robot_formation.world.overhead import OverheadCamera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface
from world_helpers import parameters

BOWL = make_surface("bowl")
P = WorldParameters().overhead


def camera(surface: Surface = BOWL, seed: int = 3, **values: float) -> OverheadCamera:
    return OverheadCamera(surface, parameters(overhead=values), seed)


def dot_of(pose: Pose) -> npt.NDArray[np.float64]:
    return np.array(pose.position) + pose.matrix() @ [0.0, 0.0, 0.216]


def poses(generator: np.random.Generator, count: int) -> list[Pose]:
    return [
        pose_on_surface(BOWL, x, y, yaw)
        for x, y, yaw in (
            (*generator.uniform(0.05, 1.73, 2), generator.uniform(-math.pi, math.pi)) for _ in range(count)
        )
    ]


def distorted(point: npt.NDArray[np.float64]) -> tuple[float, float]:
    """OpenCV's five-parameter model, written out from its documentation."""
    x, y = (point[0] - P.x_m) / (P.z_m - point[2]), -(point[1] - P.y_m) / (P.z_m - point[2])
    r2 = x * x + y * y
    radial = 1 + P.k1 * r2 + P.k2 * r2**2 + P.k3 * r2**3
    u = x * radial + 2 * P.p1 * x * y + P.p2 * (r2 + 2 * x * x)
    v = y * radial + P.p1 * (r2 + 2 * y * y) + 2 * P.p2 * x * y
    return P.focal_length_px * u + P.centre_x_px, P.focal_length_px * v + P.centre_y_px


def test_projection_is_opencvs_lens_model_looking_straight_down() -> None:
    points = np.random.default_rng(1).uniform([0, 0, 0], [1.78, 1.78, 0.45], (50, 3))
    assert camera().project(points) == pytest.approx(np.array([distorted(point) for point in points]), abs=1e-9)


def test_the_pictures_right_is_plus_x_and_its_top_plus_y() -> None:
    middle, right, top = camera().project(np.array([[0.89, 0.89, 0.2], [1.2, 0.89, 0.2], [0.89, 1.2, 0.2]]))
    assert right[0] > middle[0] + 50
    assert top[1] < middle[1] - 50


def test_dots_are_drawn_where_they_are_to_a_tenth_of_a_pixel() -> None:
    generator = np.random.default_rng(2)
    seen = camera(noise=0.0)
    for pose in poses(generator, 40):
        (found,) = find_dots(seen.view([pose]), 150, 48.0)
        assert found == pytest.approx(seen.project(dot_of(pose)[None])[0], abs=0.1)


def test_the_whole_plate_with_robots_at_its_corners_is_in_the_picture() -> None:
    corners = [(x, y) for x in (0.0, 1.78) for y in (0.0, 1.78)]
    pixels = camera().project(np.array([dot_of(pose_on_surface(BOWL, x, y, 0.7)) for x, y in corners]))
    assert pixels.min() > 8.0
    assert pixels.max() < 512.0 - 8.0


def test_a_picture_does_not_depend_on_earlier_ones() -> None:
    generator = np.random.default_rng(4)
    used, robots = camera(), poses(generator, 4)
    for number in range(12):
        robots[generator.integers(4)] = poses(generator, 1)[0]
        assert np.array_equal(used.frame(robots, number), camera().frame(robots, number))
    assert np.array_equal(used.frame([], 0), camera().frame([], 0))


def test_robots_out_of_view_leave_no_trace() -> None:
    seen = camera()
    empty = seen.view([])
    for x, y in ((-3.0, 0.9), (30.0, 30.0), (0.9, 9.0)):
        assert np.array_equal(seen.view([pose_on_surface(make_surface("plane"), x, y, 0.0)]), empty)


def test_a_picture_handed_out_is_not_drawn_into_later() -> None:
    seen = camera()
    first = seen.view([])
    copy = first.copy()
    seen.view([pose_on_surface(BOWL, 0.9, 0.9, 0.0)])
    assert np.array_equal(first, copy)


def test_noise_has_its_size_and_depends_on_seed_and_number_only() -> None:
    seen = camera(noise=2.0)
    noise = seen.frame([], 7).astype(float) - seen.view([])
    assert noise.std() == pytest.approx(math.sqrt(2.0**2 + 1 / 12), rel=0.03)
    assert noise.mean() == pytest.approx(0.0, abs=0.03)
    again = camera(noise=2.0)
    again.frame([], 5)
    assert np.array_equal(again.frame([], 7), seen.frame([], 7))
    assert not np.array_equal(seen.frame([], 8), seen.frame([], 7))
    assert not np.array_equal(camera(seed=4, noise=2.0).frame([], 7), seen.frame([], 7))


def test_the_good_calibration_of_config_is_the_camera_of_config() -> None:
    scenario = load_track("two")
    world, tracker = scenario.world, scenario.overhead_tracker
    camera_values, good = to_mapping(world.overhead), to_mapping(tracker.good)
    shared = sorted(set(camera_values) & set(good))
    assert len(shared) == 11
    assert [good[name] for name in shared] == [camera_values[name] for name in shared]
    assert (tracker.dot_height_m, tracker.dot_radius_m) == (world.marker.top_m, world.marker.dot_radius_m)
