"""Transforms that the world publishes where tf2_msgs is installed; here a stand-in takes the publishers' place."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from graph_tools import short_scenario
from robot_formation import conversions, names
from robot_formation.bag.reader import read_bag
from robot_formation.experiment.in_process import InProcessRun, run_in_process
from robot_formation.names import Topic
from robot_formation.nodes.host.live_transforms import LiveTransforms, transform_topics
from synthetic_bag import STORE

TYPE = "tf2_msgs/msg/TFMessage"


@pytest.fixture(scope="module")
def run() -> list[tuple[str, Any]]:
    """Every message of a short run: (topic, message)."""
    sent = []

    def listen(name: str, message: Any) -> None:
        sent.append((name, message))

    InProcessRun(short_scenario("leader.timesteps=1"), listen=listen).run()
    return sent


def made_of(run: Sequence[tuple[str, Any]], namespace: str) -> list[tuple[Topic, bytes]]:
    """What the world would publish, by topic as it names them."""
    types = {
        names.absolute("", names.ground_truth_odom(robot).name): names.ground_truth_odom(robot)
        for robot in ("leader", "follower_1")
    }
    types |= {
        names.absolute("", names.robot_description(robot).name): names.robot_description(robot)
        for robot in ("leader", "follower_1")
    }
    live = LiveTransforms(namespace)
    return [made for name, message in run if name in types for made in live.of(types[name], message)]


def test_they_are_those_that_a_recorder_makes(run: list[tuple[str, Any]], tmp_path: Path) -> None:
    scenario = short_scenario("leader.timesteps=1")
    run_in_process(scenario, tmp_path / "bag", {})
    with read_bag(tmp_path / "bag") as bag:
        recorded = [STORE.serialize_cdr(message.message, TYPE) for message in bag.messages(["/tf"])]
    live = [cdr for topic, cdr in made_of(run, "/") if topic == names.TF]
    assert sorted(map(bytes, recorded)) == sorted(live)
    assert len(live) > 20


def test_fixed_frames_grow_to_those_of_all_robots(run: list[tuple[str, Any]]) -> None:
    static: list[Any] = [
        STORE.deserialize_cdr(cdr, TYPE) for topic, cdr in made_of(run, "/site_a") if topic == names.TF_STATIC
    ]
    frames = {entry.child_frame_id for entry in static[-1].transforms}
    assert {"leader/odom", "follower_1/odom", "leader/marker", "follower_1/camera_optical_frame"} <= frames


def test_other_messages_give_none() -> None:
    assert list(LiveTransforms("/").of(names.left_plate(), conversions.string("leader"))) == []


def test_without_tf2_msgs_there_are_no_such_topics(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_package(type_name: str) -> None:
        raise ModuleNotFoundError(type_name)

    monkeypatch.setattr(conversions, "message_class", no_package)
    assert transform_topics() == []
    monkeypatch.setattr(conversions, "message_class", lambda type_name: object)
    assert transform_topics() == [names.TF, names.TF_STATIC]
