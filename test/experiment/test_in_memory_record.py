"""A run in memory is analysed as the bag of the same run is."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robot_formation.analysis.from_bag import load_run, run_topics
from robot_formation.analysis.quantities import analyse
from robot_formation.bag.run_details import slots_text
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import InProcessRun, run_in_process
from robot_formation.experiment.run_result import RunError
from robot_formation.experiment.scenario import Scenario, load_track, override
from robot_formation.names import Topic, absolute

pytestmark = pytest.mark.slow

BASE = ["world.camera.mode=on_demand", "leader.timesteps=5", "predictor.name=formation"]
CASES = {
    "one follower": ["seed=1000"],
    "two followers under the overhead camera": ["seed=3", "followers=2", "leader.timesteps=4"],
    "an echelon": ["followers=2", "formation=echelon", "start_y_m=0.3", "leader.timesteps=2"],
    "lost": ["world.camera.pan_deg=-90"],
}


@pytest.mark.long
@pytest.mark.parametrize("settings", CASES.values(), ids=CASES)
def test_the_analysis_is_that_of_the_bag_of_the_same_run(tmp_path: Path, settings: list[str]) -> None:
    scenario = override(load_track("one"), [*BASE, *settings])
    details = {
        "scenario": scenario.setup.name,
        "timesteps": str(scenario.leader.timesteps),
        "slots": slots_text(scenario.slots),
    }
    result = run_in_process(scenario, tmp_path / "bag", details)
    recorded = load_run(tmp_path / "bag")
    record = run_in_memory(scenario)
    said = dict(record.details)
    assert json.loads(said.pop("parameters"))["fine_tuner"]["formation_distance_m"] == 0.32
    assert said == {**details, "outcome": "lost" if result.exit_code else "done"}
    assert record.leader_moved == recorded.leader_moved
    assert record.simulated_s == recorded.simulated_s
    assert repr(analyse(record).to_json()) == repr(analyse(recorded).to_json())


def test_a_short_run_is_done_and_a_lost_one_lost() -> None:
    done = analyse(run_in_memory(override(load_track("two"), ["leader.timesteps=1", "world.camera.mode=on_demand"])))
    assert (done.outcome, done.scenario) == ("done", "track_two")
    lost = analyse(run_in_memory(override(load_track("two"), [*BASE, "world.camera.pan_deg=-90"])))
    assert (lost.outcome, lost.followers[0].lost) == ("lost", True)


def test_without_the_ground_the_analysis_is_the_same() -> None:
    scenario = override(load_track("two"), [*BASE, "seed=3"])
    whole, bare = run_in_memory(scenario), run_in_memory(scenario, ground=False)
    assert whole.ground is not None
    assert bare.ground is None
    assert repr(analyse(bare).to_json()) == repr(analyse(whole).to_json())


def test_what_nobody_hears_is_not_made_and_no_other_topic_is_told() -> None:
    scenario = override(load_track("two"), ["leader.timesteps=1", "world.camera.mode=on_demand"])
    made: list[set[str]] = []

    class Run(InProcessRun):
        def _send(self, namespace: str, topic: Topic, message: Any) -> None:
            made[-1].add(absolute(namespace, topic.name))
            super()._send(namespace, topic, message)

    for heard in (None, {"/ground_truth/leader/odom"}, set[str]()):
        made.append(set())
        told: set[str] = set()
        Run(scenario, listen=lambda topic, message, into=told: into.add(topic), heard=heard).run()  # type: ignore[misc]
        assert told == (made[-1] if heard is None else heard)
    truth = {robot: {f"/ground_truth/{robot}/{kind}" for kind in ("odom", "pose", "path")} for robot in scenario.robots}
    assert made[0] - made[1] == {"/surface", "/clock"} | truth["follower_1"]
    assert made[1] - made[2] == truth["leader"]


def test_the_run_may_be_of_another_make_and_only_topics_of_the_analysis_are_kept() -> None:
    seen, made = set(), []

    class Run(InProcessRun):
        def _send(self, namespace: str, topic: Topic, message: Any) -> None:
            seen.add(topic.name)
            super()._send(namespace, topic, message)

    def make_run(scenario: Scenario, listen: Callable[[str, Any], None]) -> InProcessRun:
        made.append(Run(scenario, listen=listen))
        return made[0]

    scenario = override(load_track("two"), ["leader.timesteps=1", "world.camera.mode=on_demand"])
    record = run_in_memory(scenario, make_run)
    assert len(made) == 1
    assert "blocks" in seen
    assert not any(topic.endswith("blocks") for topic in run_topics(scenario.robots))
    assert len(record.followers[0].displacements) == 1


def test_a_run_that_stands_still_is_an_error() -> None:
    stuck = override(load_track("two"), [*BASE, "world.lockstep=[leader,follower_1]"])
    with pytest.raises(RunError, match="everybody waits"):
        run_in_memory(stuck)
