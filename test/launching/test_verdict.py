"""How a run is judged after its own end: by its recorder, its bag and nodes that died late."""

import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from graph_tools import short_scenario
from robot_formation.bag.bag_path import recover_hint
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.writer import BagWriter
from robot_formation.experiment.run_result import RunError, RunResult
from robot_formation.launching.launcher import Launcher
from synthetic_bag import STORE, text

STRING = "std_msgs/msg/String"


def child(name: str, code: int | None = 0, *, forced: bool = False) -> Any:
    """A stand-in for a node that has ended."""
    executable = name.rpartition("/")[2]
    death = f"ended with exit code {code}"
    if code is not None and code < 0:
        death = f"was killed by {signal.Signals(-code).name}"
    process = SimpleNamespace(executable=executable)
    return SimpleNamespace(name=name, process=process, exit_code=code, forced=forced, death=death)


def test_nodes_that_are_stopped_go_on_before_a_refusal_ends_the_run() -> None:
    launcher = Launcher(short_scenario(), None)
    refused, stopped = child("/drive", 2), child("/world")
    signals: list[int] = []
    refused.last_words, refused.state = lambda: "no such parameter", ""
    stopped.state, stopped.signal = "T", signals.append
    launcher._children = [refused, stopped]
    with pytest.raises(RunError, match="/drive: no such parameter"):
        launcher._ended_by(refused, None)  # type: ignore[arg-type]
    assert signals == [signal.SIGCONT]


def judged(bag: Path, *children: Any, result: RunResult | None = None) -> RunResult:
    launcher = Launcher(short_scenario(), bag)
    launcher._children = list(children)
    result = result or RunResult(0, bag)
    launcher._settle(result)
    return result


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        writer.write("/words", bytes(STORE.serialize_cdr(text("hello"), STRING)), 5)
    return tmp_path / "bag"


def test_a_run_whose_nodes_all_end_well_is_done(bag: Path) -> None:
    result = judged(bag, child("/recorder"), child("/world"))
    assert (result.exit_code, result.reason, result.bag, result.warnings) == (0, "", bag, [])


@pytest.mark.parametrize("code", [1, 3, None, -signal.SIGKILL, -signal.SIGBUS])
@pytest.mark.parametrize("before", [0, 3])
def test_a_recorder_that_failed_at_the_end_makes_it_a_failure(bag: Path, before: int, code: int | None) -> None:
    result = judged(bag, child("/recorder", code), child("/world"), result=RunResult(before, bag))
    assert result.exit_code == 4
    assert result.reason.startswith("node /recorder ")
    assert result.bag == bag


def test_a_recorder_that_had_to_be_killed_is_said_so(bag: Path) -> None:
    bag.rename(bag.with_name("bag.partial"))
    result = judged(bag, child("/recorder", -signal.SIGKILL, forced=True))
    assert (result.exit_code, "had to be killed" in result.reason) == (4, True)


@pytest.mark.parametrize("before", [0, 3])
def test_a_recorder_that_hung_after_it_had_closed_its_bag_is_named_in_a_warning(bag: Path, before: int) -> None:
    result = judged(bag, child("/recorder", -signal.SIGKILL, forced=True), result=RunResult(before, bag))
    assert (result.exit_code, result.reason, result.bag) == (before, "", bag)
    assert len(result.warnings) == 1
    assert result.warnings[0].endswith("; its bag is whole")


def test_a_bag_that_is_not_there_makes_it_a_failure(tmp_path: Path) -> None:
    result = judged(tmp_path / "bag", child("/recorder"))
    assert (result.exit_code, result.bag) == (4, None)
    assert str(tmp_path / "bag") in result.reason


def test_another_node_that_dies_after_the_end_is_named_in_a_warning(bag: Path) -> None:
    result = judged(bag, child("/recorder"), child("/world", -signal.SIGKILL))
    assert result.exit_code == 0
    assert result.warnings == ["node /world was killed by SIGKILL, after the run's end"]


def test_the_way_to_the_nodes_deaths_of_an_interrupted_run_is_not_told(bag: Path) -> None:
    result = judged(bag, child("/recorder"), child("/world", -signal.SIGINT), result=RunResult(130, bag, "interrupted"))
    assert (result.exit_code, result.reason, result.warnings) == (130, "interrupted", [])


def test_a_message_that_names_the_partial_bag_follows_the_bag_when_it_was_completed(bag: Path) -> None:
    partial = bag.with_name("bag.partial")
    bag.rename(partial)
    reason = f"node /recorder ended with exit code 1: File too large{recover_hint(partial)}"
    result = judged(bag, child("/recorder", 1), result=RunResult(4, bag, reason))
    assert not partial.exists()
    assert result.reason.endswith(f"File too large (what was written is in {bag})")
