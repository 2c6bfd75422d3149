"""Whole runs in one process: they end as they should, and the same seed gives the same run to the last bit."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from robot_formation import conversions
from robot_formation.bag.message_recorder import Recorder
from robot_formation.bag.reader import read_bag
from robot_formation.experiment.in_process import InProcessRun, run_in_process
from robot_formation.experiment.run_result import RunError, RunResult
from robot_formation.experiment.scenario import load_track, override
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.names import absolute
from robot_formation.paths import config_dir

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("in_process")]

TIMESTEPS = 5
# Forecasts from three displacements may be as wild as their bound; bounded so, the follower can't touch the leader.
CALM = ["predictor.max_u_m=0.03", "predictor.max_v_m=0.08"]
BASE = [f"leader.timesteps={TIMESTEPS}", "world.camera.mode=on_demand", *CALM]


class Log:
    """A finished run: its exit code and everything that was said in it."""

    def __init__(self, *settings: str, track: str = "two") -> None:
        self.messages: list[tuple[str, Any]] = []
        self.scenario = override(load_track(track), [*BASE, *settings])
        self.run = InProcessRun(self.scenario, listen=lambda topic, message: self.messages.append((topic, message)))
        self.exit_code, self.reason = self.run.run()

    def of(self, topic: str) -> list[Any]:
        return [message for name, message in self.messages if name == topic]

    def bits(self, topic: str) -> list[Any]:
        """The messages of a topic; they compare field by field, numbers to the last bit."""
        return self.of(topic)

    def displacements(self, robot: str = "follower_1") -> list[Motion]:
        return [conversions.read_displacement(message) for message in self.of(f"/{robot}/displacement")]


@pytest.fixture(scope="module")
def log() -> Log:
    return Log("seed=11")


def test_a_run_ends_well_without_warnings(log: Log) -> None:
    assert (log.exit_code, log.reason) == (0, "")
    assert log.run.warnings == []


def test_every_timestep_has_one_report_one_prediction_and_one_tick_of_each_robot(log: Log) -> None:
    for topic in ("displacement", "residual", "prediction"):
        assert len(log.of(f"/follower_1/{topic}")) == TIMESTEPS
    for robot in ("leader", "follower_1"):
        assert [tick.data for tick in log.of(f"/formation/{robot}/done")] == list(range(TIMESTEPS + 1))


def test_a_timestep_goes_leader_move_corrections_report_prediction_tick(log: Log) -> None:
    chosen = {
        "/formation/leader/done": "leader",
        "/follower_1/move": "move",
        "/follower_1/displacement": "report",
        "/follower_1/prediction": "prediction",
        "/formation/follower_1/done": "follower",
        "/leader/move": "step",
    }
    story = [chosen[topic] for topic, _ in log.messages if topic in chosen]
    timesteps = " ".join(story).split("step")[1:]
    assert len(timesteps) == TIMESTEPS
    for words in map(str.split, timesteps):
        assert words[0] == "leader"
        assert words[-3:] == ["report", "prediction", "follower"]
        assert set(words[1:-3]) == {"move"}


def test_the_prediction_is_the_move_from_timestep_4_on(log: Log) -> None:
    said: list[Motion | None] = []
    predictions: list[Motion] = []
    for topic, message in log.messages:
        if topic == "/formation/leader/done" and message.data > 0:
            said.append(None)
        elif topic == "/follower_1/move" and said and said[-1] is None:
            said[-1] = conversions.read_move(message)
        elif topic == "/follower_1/prediction":
            predictions.append(conversions.read_displacement(message))
    moves = [move for move in said if move is not None]
    assert len(moves) == len(said)
    displacements = log.displacements()
    assert (moves[0].x_m, moves[0].y_m) == (0.05, 0.0)
    for timestep in (2, 3):
        assert moves[timestep - 1].x_m == pytest.approx(displacements[timestep - 2].x_m, abs=1e-15)
        assert moves[timestep - 1].y_m == pytest.approx(displacements[timestep - 2].y_m, abs=1e-15)
    for timestep in range(4, TIMESTEPS + 1):
        move, prediction = moves[timestep - 1], predictions[timestep - 2]
        assert (move.x_m, move.y_m) == (prediction.x_m, prediction.y_m)  # small turns are left out


def test_simulated_time_never_goes_back_and_reports_hold_the_stamp_of_their_last_frame(log: Log) -> None:
    stamps = [conversions.to_ns(message.clock) for message in log.of("/clock")]
    assert stamps == sorted(stamps)
    frames = {conversions.stamp_of(message) for message in log.of("/follower_1/camera/image_raw")}
    blocks = {conversions.stamp_of(message) for message in log.of("/follower_1/blocks")}
    assert frames == blocks
    for displacement, residual in zip(log.of("/follower_1/displacement"), log.of("/follower_1/residual"), strict=True):
        assert conversions.stamp_of(displacement) == conversions.stamp_of(residual)
        assert conversions.stamp_of(displacement) in blocks


def true_poses(log: Log, robot: str) -> list[Motion]:
    return [conversions.read_pose(message.pose) for message in log.of(f"/ground_truth/{robot}/pose")]


def test_displacements_are_what_the_follower_really_did_to_a_few_millimetres(log: Log) -> None:
    # True poses at rest; those at the ends of the timesteps are the last ones before each report.
    ends, pose = [], None
    for topic, message in log.messages:
        if topic == "/ground_truth/follower_1/pose":
            pose = conversions.read_pose(message.pose)
        elif topic == "/formation/follower_1/done":
            ends.append(pose)
    for before, after, measured in zip(ends[:-1], ends[1:], log.displacements(), strict=True):
        assert before is not None
        assert after is not None
        dx, dy = after.x_m - before.x_m, after.y_m - before.y_m
        c, s = math.cos(before.yaw_rad), math.sin(before.yaw_rad)
        # The plate's slope of up to 0.25 shortens the horizontal way by 3 %; turns on the way are measured roughly.
        assert math.dist((c * dx + s * dy, -s * dx + c * dy), (measured.x_m, measured.y_m)) < 0.004


def test_at_the_end_the_follower_stands_at_its_place_beside_the_leader(log: Log) -> None:
    leader, follower = true_poses(log, "leader")[-1], true_poses(log, "follower_1")[-1]
    right = (math.sin(leader.yaw_rad), -math.cos(leader.yaw_rad))
    place = (leader.x_m + FORMATION_DISTANCE_M * right[0], leader.y_m + FORMATION_DISTANCE_M * right[1])
    assert math.dist((follower.x_m, follower.y_m), place) < 0.04


def test_the_same_seed_gives_the_same_run_to_the_last_bit(log: Log) -> None:
    again = Log("seed=11")
    assert [topic for topic, _ in again.messages] == [topic for topic, _ in log.messages]
    for topic in ("displacement", "residual", "prediction", "moved", "move", "joint_states", "blocks"):
        assert again.bits(f"/follower_1/{topic}") == log.bits(f"/follower_1/{topic}")


def test_another_seed_gives_another_run(log: Log) -> None:
    other = Log("seed=12")
    assert other.bits("/follower_1/displacement") != log.bits("/follower_1/displacement")
    assert other.bits("/leader/moved") != log.bits("/leader/moved")


@pytest.mark.parametrize("predictor", ["previous", "literal"])
def test_the_leaders_path_does_not_depend_on_the_followers_predictor(log: Log, predictor: str) -> None:
    other = Log("seed=11", f"predictor.name={predictor}")
    assert other.exit_code == 0

    def path(of: Log) -> list[Any]:
        return [(m.pose.position, m.pose.orientation) for m in of.of("/ground_truth/leader/pose")]

    assert path(other) == path(log)
    motions = [[conversions.read_displacement(m) for m in of.of("/leader/moved")] for of in (log, other)]
    assert motions[0] == motions[1]
    # Later on the forecast is the process model of the alignment, so that corrections depend on the predictor.
    assert other.displacements()[0] == log.displacements()[0]
    assert other.bits("/follower_1/prediction") != log.bits("/follower_1/prediction")


def test_camera_modes_differ_only_in_frames_that_nobody_asked_for(log: Log) -> None:
    stream = Log("seed=11", "world.camera.mode=stream", "leader.timesteps=1")
    assert stream.exit_code == 0
    asked = sum(message.data for message in stream.of("/follower_1/camera/request"))
    assert len(stream.of("/follower_1/camera/image_raw")) > asked
    assert len(log.of("/follower_1/camera/image_raw")) == sum(m.data for m in log.of("/follower_1/camera/request"))


def test_two_followers_keep_their_places_one_beside_the_other() -> None:
    log = Log("followers=2", "leader.timesteps=3", track="one")
    assert log.exit_code == 0
    for robot in ("follower_1", "follower_2"):
        assert len(log.of(f"/{robot}/displacement")) == 3
        assert [tick.data for tick in log.of(f"/formation/{robot}/done")] == [0, 1, 2, 3]
    order = [topic.split("/")[2] for topic, _ in log.messages if topic.startswith("/formation/")]
    assert order == ["leader", "follower_1", "follower_2"] * 4
    first, second = true_poses(log, "follower_1")[-1], true_poses(log, "follower_2")[-1]
    assert math.dist((first.x_m, first.y_m), (second.x_m, second.y_m)) == pytest.approx(0.32, abs=0.05)


def test_a_leader_out_of_view_ends_the_run_as_lost() -> None:
    log = Log("world.camera.pan_deg=-90")
    assert log.exit_code == 3
    assert re.fullmatch(r"follower_1 lost its beacon neighbour in timestep 0: not found again in \d+ looks", log.reason)
    assert re.fullmatch(r"lost: not found again in \d+ looks", log.of("/follower_1/alignment")[-1].data)
    assert log.displacements() == []


def test_signatures_of_colours_that_are_not_there_end_the_run_as_lost(tmp_path: Path) -> None:
    taught = yaml.safe_load((config_dir() / "signatures.yaml").read_text(encoding="utf-8"))
    for signature in taught["signatures"]:
        signature["sig"] += 3
    path = tmp_path / "other.yaml"
    path.write_text(yaml.safe_dump(taught), encoding="utf-8")
    assert Log(f"block_detector.signatures_file={path}").exit_code == 3


STUCK = "world.lockstep=[leader,follower_1]"  # each would have to move for the other to


def test_a_run_in_which_everybody_waits_is_ended() -> None:
    with pytest.raises(RunError, match="everybody waits for somebody"):
        InProcessRun(override(load_track("two"), [*BASE, STUCK])).run()


def test_moves_that_the_world_refuses_are_answered_and_said() -> None:
    scenario = override(load_track("two"), [*BASE, "drive.wheel_speed_rad_s=50"])  # more than the motors can do
    run = InProcessRun(scenario)
    run.run()
    assert any("50 rad/s" in warning for warning in run.warnings)


# --- with a bag -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunResult, list[str]]:
    path = tmp_path_factory.mktemp("bags") / "run"
    lines: list[str] = []
    scenario = override(load_track("two"), [*BASE, "seed=11"])
    return run_in_process(scenario, path, {"scenario": "two", "seed": "11"}, say=lines.append), lines


def test_a_recorded_run_has_all_topics_but_the_pictures(recorded: tuple[RunResult, list[str]], log: Log) -> None:
    result, _ = recorded
    assert (result.exit_code, result.reason, result.warnings) == (0, "", [])
    assert result.bag is not None
    with read_bag(result.bag) as bag:
        said = {topic for topic, _ in log.messages}
        made = {"/tf", "/tf_static"}  # by the recorder, of poses and descriptions
        assert set(bag.topics) - made == {topic for topic in said if not topic.endswith("image_raw")}
        assert bag.metadata("robot_formation") == {"scenario": "two", "seed": "11"}
        transforms = sum(1 for _ in bag.messages(made))
        assert bag.message_count - transforms == sum(not topic.endswith("image_raw") for topic, _ in log.messages)


def test_the_bag_holds_the_displacements_of_the_same_run_to_the_last_bit(
    recorded: tuple[RunResult, list[str]], log: Log
) -> None:
    result, _ = recorded
    assert result.bag is not None
    with read_bag(result.bag) as bag:
        found = [m.message.pose.pose.position for m in bag.messages(["/follower_1/displacement"])]
    assert [(p.x, p.y) for p in found] == [(motion.x_m, motion.y_m) for motion in log.displacements()]


def test_progress_is_one_line_per_timestep(recorded: tuple[RunResult, list[str]]) -> None:
    _, lines = recorded
    assert len(lines) == TIMESTEPS
    for number, line in enumerate(lines, start=1):
        assert line.startswith(f"timestep {number:2d}/{TIMESTEPS}  correction ")
        assert "formation error" in line
        assert "?" not in line


def test_pictures_are_recorded_when_wanted(tmp_path: Path) -> None:
    scenario = override(load_track("two"), [*BASE, "leader.timesteps=1"])
    result = run_in_process(scenario, tmp_path / "run", {}, images=True)
    assert result.bag is not None
    with read_bag(result.bag) as bag:
        (first, *_) = bag.messages(["/follower_1/camera/image_raw"])
        pixels = np.reshape(first.message.data, (first.message.height, first.message.width, 3))
    assert pixels.shape == (208, 316, 3)
    assert pixels.std() > 1.0


def test_without_a_bag_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = run_in_process(override(load_track("two"), [*BASE, "leader.timesteps=1"]), None, {})
    assert result.bag is None
    assert list(tmp_path.iterdir()) == []


def test_a_lost_run_closes_its_bag_in_good_order_and_says_so(tmp_path: Path) -> None:
    lines: list[str] = []
    scenario = override(load_track("two"), [*BASE, "world.camera.pan_deg=-90"])
    result = run_in_process(scenario, tmp_path / "run", {}, say=lines.append)
    assert result.exit_code == 3
    (line,) = lines
    assert line.startswith("follower_1: lost its beacon neighbour in timestep")
    assert result.bag is not None
    with read_bag(result.bag) as bag:
        assert not bag.recovered
        assert "/follower_1/alignment" in bag.topics


def test_a_run_that_breaks_closes_its_bag_too(tmp_path: Path) -> None:
    result = run_in_process(override(load_track("two"), [*BASE, STUCK]), tmp_path / "run", {})
    assert result.exit_code == 4
    assert "everybody waits" in result.reason
    with read_bag(tmp_path / "run") as bag:
        assert not bag.recovered


def test_a_topic_is_declared_once_with_the_qos_of_its_publisher(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run", {})
    scenario = override(load_track("two"), [*BASE, "leader.timesteps=1"])
    InProcessRun(scenario, recorder).run()
    recorder.close()
    text = (tmp_path / "run" / "metadata.yaml").read_text(encoding="utf-8")
    topics = yaml.safe_load(text)["rosbag2_bagfile_information"]["topics_with_message_count"]
    offered = {
        entry["topic_metadata"]["name"]: entry["topic_metadata"]["offered_qos_profiles"][0]["durability"]
        for entry in topics
    }
    assert offered["/follower_1/displacement"] == "transient_local"
    assert offered["/follower_1/blocks"] == "volatile"


def test_relative_topics_lie_in_the_namespace_and_absolute_ones_stay() -> None:
    assert absolute("/leader", "move") == "/leader/move"
    assert absolute("", "surface") == "/surface"
    assert absolute("/leader", "/formation/leader/done") == "/formation/leader/done"
