"""Nodes that somebody else starts: which ones a name means, and what follows from what is in the graph."""

import pytest

from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.scenario import Scenario
from robot_formation.experiment.stand_ins import StandIns, how_to_start, stand_ins_of

DETECTORS = ("/follower_1/block_detector", "/follower_2/block_detector")


def scenario(*settings: str) -> Scenario:
    return scenarios.override(scenarios.load_track("one"), ["followers=2", *settings])


@pytest.mark.parametrize(
    ("asked", "nodes"),
    [
        ([], ()),
        (["block_detector"], ("follower_1/block_detector", "follower_2/block_detector")),
        (["follower_2/block_detector"], ("follower_2/block_detector",)),
        (["/follower_2/block_detector", "follower_2/block_detector"], ("follower_2/block_detector",)),
        (["drive"], ("leader/drive", "follower_1/drive", "follower_2/drive")),
        (["leader"], ("leader/leader",)),
        (["predictor", "world"], ("world", "follower_1/predictor", "follower_2/predictor")),
    ],
)
def test_a_name_means_one_robots_node_or_that_of_every_robot(asked: list[str], nodes: tuple[str, ...]) -> None:
    assert stand_ins_of(scenario(), asked, "--without") == nodes


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("block_detektor", "did you mean 'block_detector'?"),
        ("follower_3/block_detector", "did you mean 'follower_"),
        ("recorder", "; there are: block_detector, "),
        ("", "; there are: block_detector, "),
    ],
)
def test_a_name_that_no_node_has_is_told_with_the_nearest(name: str, hint: str) -> None:
    with pytest.raises(FormationError) as error:
        stand_ins_of(scenario(), [name], "--without")
    assert str(error.value).startswith(f"--without: this run has no node '{name}' to leave out")
    assert hint in str(error.value)


def test_a_node_that_this_run_does_not_have_cannot_be_left_out() -> None:
    with pytest.raises(FormationError, match="no node 'overhead_tracker'"):
        stand_ins_of(scenario("world.overhead.enabled=false"), ["overhead_tracker"], "--without")


def test_the_words_name_variables_namespace_and_node() -> None:
    first, one, other = how_to_start(["/world", "/site/leader/drive"], 60.0, "ROS_DOMAIN_ID=7", ["--x a", "--x b"])
    assert "for at most 60 s" in first
    assert one == "start /world: ROS_DOMAIN_ID=7 COMMAND --ros-args -r __ns:=/ -r __node:=world --x a"
    assert other.endswith("COMMAND --ros-args -r __ns:=/site/leader -r __node:=drive --x b")
    assert how_to_start(["/world"], 60.0)[1] == "start /world: COMMAND --ros-args -r __ns:=/ -r __node:=world"


class Watched:
    """`StandIns` with a clock of the test's own."""

    def __init__(self, timeout_s: float = 10.0) -> None:
        self.now_s = 100.0
        self.said: list[str] = []
        self.stand_ins = StandIns(DETECTORS, timeout_s, self.said.append, lambda: self.now_s)

    def look(self, *graph: str, after_s: float = 1.0, begun: bool = False) -> str:
        self.now_s += after_s
        return self.stand_ins.look(graph, begun=begun)


def test_each_that_appears_is_told_and_the_run_waits_for_the_last() -> None:
    watched = Watched()
    assert watched.look() == ""
    assert watched.look(DETECTORS[1], "/world") == ""
    assert watched.stand_ins.awaited
    assert watched.look(*DETECTORS) == ""
    assert not watched.stand_ins.awaited
    one, other = DETECTORS
    assert watched.said == [f"{other} is there; still waiting for {one}", f"{one} is there"]


def test_time_counts_until_all_are_there_and_no_longer() -> None:
    watched = Watched()
    assert watched.look(DETECTORS[0], after_s=10.0) == ""
    assert watched.look(DETECTORS[0]) == f"no node {DETECTORS[1]} appeared within 10 s"
    watched = Watched()
    assert watched.look(*DETECTORS, after_s=9.0) == ""
    assert watched.look(*DETECTORS, after_s=1000.0) == ""


def test_one_that_goes_is_told_also_while_others_are_awaited() -> None:
    watched = Watched()
    watched.look(DETECTORS[0])
    assert watched.look() == f"node {DETECTORS[0]}, started elsewhere, is gone"


def test_one_that_is_not_seen_although_the_run_has_begun_is_told_after_as_long_as_a_dead_one_is_listed() -> None:
    watched = Watched(timeout_s=300.0)
    one, other = DETECTORS
    assert watched.look(one, after_s=100.0) == ""
    assert watched.look(one, begun=True) == ""
    assert watched.look(one, begun=True, after_s=20.0) == ""
    missing = f"node {other}, started elsewhere, was never seen, although the run has begun"
    assert watched.look(one, begun=True, after_s=0.1) == missing
    watched = Watched(timeout_s=300.0)
    watched.look(one, begun=True)
    assert watched.look(*DETECTORS, begun=True, after_s=20.0) == ""
    assert watched.look(*DETECTORS, begun=True, after_s=1000.0) == ""


def test_the_graph_is_looked_at_now_and_then_and_never_without_stand_ins() -> None:
    watched = Watched()
    assert watched.stand_ins.due
    watched.look(after_s=0.0)
    assert not watched.stand_ins.due
    watched.now_s += 0.5
    assert watched.stand_ins.due
    assert not StandIns((), 10.0, watched.said.append).due


def test_a_run_that_is_done_before_its_stand_in_was_seen_says_so_at_its_end() -> None:
    watched = Watched()
    one, other = DETECTORS
    assert watched.look(one) == ""
    watched.stand_ins.run_done()
    assert watched.said[1:] == [f"{other} was there"]
    assert not watched.stand_ins.awaited
