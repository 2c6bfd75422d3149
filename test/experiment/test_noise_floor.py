"""The noise floor: what the ideal move is, and that a run really carries it out."""

import math
from typing import Any

import numpy as np
import pytest

from robot_formation import conversions
from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.components.predictor import PredictorComponent
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.noise_floor import IdealRun, TargetFace
from robot_formation.experiment.scenario import load_track, override, with_surface
from robot_formation.experiment.sweep import Task, run_task
from robot_formation.geometry.orientation import quaternion
from robot_formation.geometry.se2 import Motion
from robot_formation.world.camera import Camera
from robot_formation.world.pose import Pose, pose_on_surface

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("noise_floor")]

TIMESTEPS = 8
ALIGNMENT = AlignmentParameters()
# The pinhole's own side-length curve, focal length times edge: with it, on level ground, offsets are true distances.
PINHOLE = AlignmentParameters(side_px_m=273.7 * 0.06)


def level(x_m: float, y_m: float, yaw_rad: float = 0.0) -> Pose:
    return Pose((x_m, y_m, 0.0), quaternion(0.0, 0.0, yaw_rad))


@pytest.fixture(scope="module")
def world() -> WorldNodeParameters:
    scenario = with_surface(load_track("two"), "plane")
    return scenario.world


@pytest.fixture(scope="module")
def face(world: WorldNodeParameters) -> TargetFace:
    return TargetFace(Camera(world.make_surface(), world), world)


# --- the Target face --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7, -2.5])
def test_at_the_ideal_place_there_is_no_offset_wherever_the_pair_stands(
    world: WorldNodeParameters, face: TargetFace, yaw_rad: float
) -> None:
    assert PINHOLE.side_px_m == world.camera.focal_length_px * world.marker.edge_m
    right = (0.32 * math.sin(yaw_rad), -0.32 * math.cos(yaw_rad))
    neighbour = level(0.8, 0.9, yaw_rad)
    robot = level(0.8 + right[0], 0.9 + right[1], yaw_rad)
    assert face.offset(robot, neighbour, PINHOLE) == pytest.approx((0.0, 0.0), abs=1e-12)
    # The fine-tuner's curve is fitted to what the detector reports; on true sides it is a few millimetres off.
    assert face.offset(robot, neighbour, ALIGNMENT) == pytest.approx((0.0, 0.0), abs=5e-3)


@pytest.mark.parametrize("x_m", [-0.04, -0.01, 0.0, 0.02, 0.05])
@pytest.mark.parametrize("y_m", [-0.4, -0.34, -0.32, -0.3])
def test_on_level_ground_the_offset_is_that_of_the_pinhole(
    world: WorldNodeParameters, face: TargetFace, x_m: float, y_m: float
) -> None:
    # Both robots head along x: the face is parallel to the picture, so its image is a square.
    camera, edge_m = world.camera, world.marker.edge_m
    depth_m = -edge_m / 2.0 - (y_m + camera.y_m)
    # The camera looks left: the picture's right is the robot's front, and a neighbour's face ahead lies right.
    column_px = camera.focal_length_px * -(x_m + camera.x_m) / depth_m
    found = face.offset(level(x_m, y_m), level(0.0, 0.0), PINHOLE)
    assert found[0] == pytest.approx(column_px / ALIGNMENT.slope_px_per_m, abs=1e-12)
    assert found[1] == pytest.approx(depth_m - ALIGNMENT.distance_m, abs=1e-12)


def test_the_offset_points_from_the_robot_to_its_place(face: TargetFace) -> None:
    ahead, behind = (face.offset(level(x, -0.32), level(0.0, 0.0), ALIGNMENT)[0] for x in (0.02, -0.02))
    assert ahead < -0.015 < 0.015 < behind
    far, near = (face.offset(level(0.0, y), level(0.0, 0.0), PINHOLE)[1] for y in (-0.36, -0.28))
    assert far == pytest.approx(0.04, abs=1e-12)
    assert near == pytest.approx(-0.04, abs=1e-12)


def test_on_a_bowl_too_the_offset_is_taken_from_all_corners_of_the_face(
    world: WorldNodeParameters, face: TargetFace
) -> None:
    scenario = with_surface(load_track("two"), "bowl")
    bowl = scenario.world.make_surface()
    robot, neighbour = pose_on_surface(bowl, 1.2, 0.5, 2.0), pose_on_surface(bowl, 0.95, 0.35, 2.05)
    edge_m, top = world.marker.edge_m, world.marker.top_m
    rotation, lens = robot.matrix(), np.array(robot.place((world.camera.x_m, world.camera.y_m, world.camera.z_m)))
    tilt = math.radians(world.camera.tilt_deg)
    pan = math.radians(world.camera.pan_deg)
    ahead = rotation @ [math.cos(pan) * math.cos(tilt), math.sin(pan) * math.cos(tilt), math.sin(tilt)]
    right = rotation @ [math.sin(pan), -math.cos(pan), 0.0]
    down = np.cross(ahead, right)
    columns, rows = [], []
    for x in (-edge_m / 2.0, edge_m / 2.0):
        for z in (top - edge_m, top):
            ray = np.array(neighbour.place((x, -edge_m / 2.0, z))) - lens
            columns.append(world.camera.focal_length_px * ray @ right / (ray @ ahead))
            rows.append(world.camera.focal_length_px * ray @ down / (ray @ ahead))
    side_px = max(np.ptp(columns), np.ptp(rows))
    middle_px = (min(columns) + max(columns)) / 2.0
    expected = (middle_px / ALIGNMENT.slope_px_per_m, ALIGNMENT.side_px_m / side_px - ALIGNMENT.distance_m)
    assert face.offset(robot, neighbour, ALIGNMENT) == pytest.approx(expected, abs=1e-12)


# --- runs -------------------------------------------------------------------------------------------------------------


class Story:
    """What an ideal run said, and what its predictor was told."""

    def __init__(self, *settings: str, close: bool, surface: str = "plane") -> None:
        scenario = with_surface(load_track("two"), surface)
        base = ["world.camera.mode=on_demand", f"leader.timesteps={TIMESTEPS}", "predictor.name=formation"]
        self.scenario = override(scenario, [*base, *settings])
        self.messages: list[tuple[str, Any]] = []
        self.run = IdealRun(self.scenario, lambda *entry: self.messages.append(entry), close=close)
        self.code, _ = self.run.run()

    def of(self, topic: str) -> list[Any]:
        return [message for name, message in self.messages if name == topic]


def moves_of(story: Story) -> list[str]:
    """What the fine-tuner said of each of its moves, in order."""
    states = [message.data.split(":")[0] for message in story.of("/follower_1/alignment")]
    return [state for state in states if state in ("collect", "correct", "predict")]


@pytest.fixture(scope="module")
def closed() -> Story:
    return Story("seed=1000", close=True)


@pytest.mark.long
def test_the_noise_floor_is_below_the_correction_of_previous_on_a_plane() -> None:
    settings = ("leader.timesteps=10",)
    for seed in (1000, 1001):
        previous, ideal, close = (
            run_task(Task("two", "plane", name, seed), settings) for name in ("previous", "ideal", "ideal+close")
        )
        assert {previous.outcome, ideal.outcome, close.outcome} == {"done"}
        assert previous.correction_m is not None
        for oracle in (ideal, close):
            assert oracle.correction_m is not None
            assert oracle.correction_m < previous.correction_m


def test_only_prediction_moves_from_timestep_4_on_are_replaced(closed: Story) -> None:
    plain = []
    InProcessRun(closed.scenario, listen=lambda *entry: plain.append(entry)).run()
    own = [conversions.read_move(message) for message in closed.of("/follower_1/move")]
    theirs = [conversions.read_move(message) for name, message in plain if name == "/follower_1/move"]
    collected = [message.data for message in closed.of("/follower_1/alignment")].count("collect")
    assert collected == 3
    first = next(number for number, pair in enumerate(zip(own, theirs, strict=False)) if pair[0] != pair[1])
    states = moves_of(closed)
    assert states[first] == "predict"
    assert "predict" not in states[:first]


@pytest.mark.parametrize("surface", ["plane", "bowl"])
def test_a_move_ends_where_the_camera_would_show_no_offset(surface: str) -> None:
    story = Story("seed=1000", close=False, surface=surface)
    assert story.code == 0
    world = story.scenario.world
    ground = world.make_surface()
    face = TargetFace(Camera(ground, world), world)
    poses, predicting, errors, checked = {}, False, [], 0
    for topic, message in story.messages:
        if topic.startswith("/ground_truth/") and topic.endswith("odom"):
            p, q = message.pose.pose.position, message.pose.pose.orientation
            poses[topic.split("/")[2]] = Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        elif topic == "/follower_1/alignment":
            predicting = message.data == "predict"
        elif topic == "/follower_1/residual":
            seen = conversions.read_displacement(message)
            true = face.offset(poses["follower_1"], poses["leader"], ALIGNMENT)
            errors.append((seen.x_m - true[0], seen.y_m - true[1]))
        elif topic == "/follower_1/move" and predicting:
            motion = conversions.read_move(message)
            start = poses["follower_1"]
            x_m, y_m, _ = start.place((motion.x_m, motion.y_m, 0.0))
            offset = face.offset(pose_on_surface(ground, x_m, y_m, start.yaw_rad), poses["leader"], ALIGNMENT)
            assert motion.yaw_rad == 0.0
            assert np.add(offset, np.mean(errors, axis=0)) == pytest.approx((0.0, 0.0), abs=1e-5)
            checked += 1
    assert checked == TIMESTEPS - 3


def test_the_predictor_is_told_of_the_move_that_was_commanded(closed: Story) -> None:
    last, misses = {}, []
    for topic, message in closed.messages:
        name = topic.removeprefix("/follower_1/")
        if name == "alignment":
            last["state"] = message.data
        elif name in ("move", "moved") and last["state"] in ("collect", "predict"):
            last[name] = conversions.read_move(message) if name == "move" else conversions.read_displacement(message)
        elif name in ("commanded", "displacement"):
            last[name] = conversions.read_displacement(message)
            if name == "displacement":
                missed = (last["moved"].u_m - last["move"].u_m, last["moved"].v_m - last["move"].v_m)
                total, told = last["displacement"], last["commanded"]
                misses.append(missed)
                assert (total.u_m - told.u_m, total.v_m - told.v_m) == pytest.approx(missed, abs=1e-12)
    assert len(misses) == TIMESTEPS
    assert np.abs(misses).max() > 1e-3


def test_the_actuation_bias_is_taken_off_the_closed_floors_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    def first_prediction_move(close: bool) -> Motion:
        story = Story("seed=1000", "leader.timesteps=4", close=close)
        return conversions.read_move(story.of("/follower_1/move")[moves_of(story).index("predict")])

    monkeypatch.setattr(PredictorComponent, "actuation_bias", lambda self: (0.004, -0.007))
    plain, close = first_prediction_move(False), first_prediction_move(True)
    assert (plain.u_m - close.u_m, plain.v_m - close.v_m) == pytest.approx((0.004, -0.007), abs=1e-12)
