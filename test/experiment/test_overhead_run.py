"""The overhead camera and its tracker in runs, and their comparison with ground truth."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from graph_tools import short_scenario
from robot_formation import conversions, names
from robot_formation.analysis.from_bag import GroundTruth, load_run
from robot_formation.analysis.from_bag import record_of as record_of_messages
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.report import text_report, write_pictures
from robot_formation.analysis.run_record import RunRecord
from robot_formation.components.base import Place
from robot_formation.components.node_parameters import OverheadTrackerNodeParameters
from robot_formation.components.overhead_tracker import OverheadTrackerComponent
from robot_formation.experiment.in_process import InProcessRun, run_in_process
from robot_formation.experiment.scenario import Scenario, override
from robot_formation.launching.processes import run_metadata
from robot_formation.parameters import ParameterError
from robot_formation.surface import make_surface
from robot_formation.world.overhead import OverheadCamera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface

pytestmark = pytest.mark.slow

BOWL = make_surface("bowl")


def record_of(scenario: Scenario, bag: Path) -> RunRecord:
    run_in_process(scenario, bag, run_metadata(scenario))
    return load_run(bag)


@pytest.mark.parametrize("track", ["one", "two"])
def test_the_good_calibration_stays_below_three_millimetres(tmp_path: Path, track: str) -> None:
    analysis = analyse(record_of(short_scenario(track=track), tmp_path / "bag"))
    errors = analysis.to_json()["totals"]["overhead_error_m"]
    assert set(errors) == {"leader", "follower_1"}
    for error in errors.values():
        assert 0.0 < error["rms"] <= error["max"] < 0.003


def test_the_imperfect_calibration_errs_as_the_papers_and_both_show_in_table_and_picture(tmp_path: Path) -> None:
    scenario = short_scenario("overhead_tracker.calibration=imperfect")
    record = record_of(scenario, tmp_path / "bag")
    analysis = analyse(record)
    errors = analysis.followers[0].totals["overhead_error_m"]
    assert 0.013 < max(error["max"] for error in errors.values()) < 0.027
    leader = errors["leader"]
    words = (
        f"overhead camera                      leader RMS {100 * leader['rms']:.2f}, max {100 * leader['max']:.2f} cm;"
    )
    assert words in text_report(record, analysis)
    pictures = write_pictures(record, analysis, tmp_path / "pictures")
    assert all(picture.stat().st_size > 5000 for picture in pictures)


def sent_in(scenario: Scenario) -> dict[str, list[Any]]:
    """Every message of a run by topic."""
    found: dict[str, list[Any]] = {}
    run = InProcessRun(scenario, listen=lambda topic, message: found.setdefault(topic, []).append(message))
    assert run.run()[0] == 0
    return found


def test_switching_the_camera_off_changes_nothing_else() -> None:
    with_camera = sent_in(short_scenario())
    without = sent_in(short_scenario("world.overhead.enabled=false"))
    assert {topic for topic in with_camera if "overhead" in topic} == {
        "/overhead/image_raw",
        "/overhead/camera_info",
        "/overhead/poses",
        "/overhead/leader/path",
        "/overhead/follower_1/path",
    }
    assert without == {topic: messages for topic, messages in with_camera.items() if "overhead" not in topic}


def test_there_is_a_picture_of_the_start_and_of_every_rest() -> None:
    found = sent_in(short_scenario())
    stamps = [conversions.stamp_of(image) for image in found["/overhead/image_raw"]]
    rests = {
        conversions.stamp_of(pose)
        for robot in ("leader", "follower_1")
        for pose in found[f"/ground_truth/{robot}/pose"]
    }
    assert stamps == sorted(rests)
    assert [conversions.stamp_of(poses) for poses in found["/overhead/poses"]] == stamps
    info = found["/overhead/camera_info"][0]
    assert list(info.d) == [-0.12, 0.02, 0.0006, -0.0004, 0.0]
    assert found["/overhead/image_raw"][0].encoding == "mono8"


def test_a_run_without_tracker_has_no_overhead_error(tmp_path: Path) -> None:
    record = record_of(short_scenario("world.overhead.enabled=false", "leader.timesteps=1"), tmp_path / "bag")
    analysis = analyse(record)
    assert analysis.to_json()["totals"]["overhead_error_m"] is None
    assert "overhead camera" not in text_report(record, analysis)


def test_the_tracker_knows_robots_starts_and_ground_of_its_scenario() -> None:
    scenario = short_scenario("followers=2", "world.surface=plane", "world.surface_parameters=['height_m=0.1']")
    world, tracker = scenario.world, scenario.overhead_tracker
    for name in ("robots", "start_x_m", "start_y_m", "surface", "surface_parameters"):
        assert getattr(tracker, name) == getattr(world, name)
    wrong = override(scenario, ["overhead_tracker.surface=bowl", "overhead_tracker.surface_parameters=[]"])
    assert wrong.overhead_tracker.surface == "bowl"


# --- the component ------------------------------------------------------------------------------------------------

STARTS = {"leader": (0.76, 0.16), "follower_1": (1.08, 0.16)}


class Station:
    """The component with a camera above it; robots stand heading along +y."""

    def __init__(self, **values: Any) -> None:
        self.camera = OverheadCamera(BOWL, WorldParameters(), 1)
        self.component = OverheadTrackerComponent(OverheadTrackerNodeParameters(**values), Place(""))
        self.sent: list[tuple[str, Any]] = []
        self.said: list[str] = []
        self.component.attach(
            lambda topic, message: self.sent.append((topic.name, conversions.as_message(message, topic.type))),
            lambda level, text: self.said.append(text),
        )
        ((self.topic, self.take),) = [(entry.topic, entry.handler) for entry in self.component.inputs()]

    def look(self, places: Iterable[tuple[float, float]], stamp_ns: int) -> dict[str, Any]:
        self.sent.clear()
        picture = self.camera.frame([pose_on_surface(BOWL, *place, np.pi / 2) for place in places], stamp_ns)
        self.take(conversions.image(picture, names.OVERHEAD_FRAME, stamp_ns))
        return dict(self.sent)


def positions(poses: Iterable[Any]) -> list[tuple[float, float]]:
    return [(pose.position.x, pose.position.y) for pose in poses]


def test_poses_come_in_the_order_of_the_robots_and_a_hidden_one_keeps_its_last_place() -> None:
    station = Station()
    both = station.look(STARTS.values(), 0)
    assert set(both) == {"overhead/poses", "overhead/leader/path", "overhead/follower_1/path"}
    first = positions(both["overhead/poses"].poses)
    assert first[0] == pytest.approx(STARTS["leader"], abs=0.05)
    assert first[1] == pytest.approx(STARTS["follower_1"], abs=0.05)
    hidden = station.look([(1.08, 0.2)], 10**9)
    assert set(hidden) == {"overhead/poses", "overhead/follower_1/path"}
    second = positions(hidden["overhead/poses"].poses)
    assert second[0] == first[0]
    assert second[1][1] == pytest.approx(first[1][1] + 0.04, abs=0.01)
    assert station.component.details() == {"pictures": "2", "unseen": "leader"}
    path = hidden["overhead/follower_1/path"]
    assert [conversions.stamp_of(pose) for pose in path.poses] == [0, 10**9]
    assert path.header.frame_id == hidden["overhead/poses"].header.frame_id == "world"


def test_time_that_goes_back_begins_new_paths() -> None:
    station = Station()
    station.look(STARTS.values(), 5 * 10**9)
    again = station.look(STARTS.values(), 0)
    assert len(again["overhead/leader/path"].poses) == 1


def test_colour_pictures_are_taken_and_others_refused() -> None:
    station = Station()
    grey = station.camera.frame([pose_on_surface(BOWL, *place, 0.0) for place in STARTS.values()], 0)
    station.take(conversions.image(np.repeat(grey[:, :, None], 3, axis=2), "", 0))
    assert station.component.details()["unseen"] == ""
    station.sent.clear()
    depth = conversions.image(grey, "", 0)
    depth.encoding = "16UC1"
    cut = conversions.image(grey, "", 0)
    cut.height = 600
    for message, word in ((depth, "16UC1"), (cut, "cut off")):
        station.take(message)
        assert word in station.said[-1]
    assert station.sent == []


def test_robots_without_a_start_are_refused() -> None:
    with pytest.raises(ParameterError, match="start_x_m"):
        dataclasses.replace(OverheadTrackerNodeParameters(), robots=("leader",))


def stamped(second: int, **fields: Any) -> SimpleNamespace:
    stamp = SimpleNamespace(sec=second, nanosec=0)
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), **fields)


def pose(x: float) -> SimpleNamespace:
    turn = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    return SimpleNamespace(position=SimpleNamespace(x=x, y=0.0, z=0.216), orientation=turn)


def test_a_robot_that_the_camera_never_saw_has_no_error_and_one_seen_late_none_before() -> None:
    told = {"leader": [0.1, 0.11, 0.12, 0.12], "follower_1": [0.5] * 4, "follower_2": [0.7, 0.7, 0.71, 0.72]}
    messages = {
        "/overhead/poses": [
            stamped(second, poses=[pose(places[second]) for places in told.values()]) for second in range(4)
        ],
    }
    turn = np.array([[0.0, 0.0, 0.0, 1.0]])
    truth = {
        robot: GroundTruth(np.array([0]), np.array([[places[0], 0.0, 0.0]]), turn) for robot, places in told.items()
    }
    overhead = record_of_messages(list(told), messages, {}, {}, truth).overhead
    assert {robot: list(track.seen_m[:, 0]) for robot, track in overhead.items()} == {
        "leader": [0.1, 0.11, 0.12],
        "follower_2": [0.71, 0.72],
    }
