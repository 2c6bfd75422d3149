"""The watchdog names the node that hangs, and nobody when the machine, the launcher or a node is only slow."""

from collections.abc import Collection

import pytest

from robot_formation.launching.watchdog import Watchdog

NODES = ("/world", "/follower_1/predictor", "/recorder")


class Run:
    """A watchdog on a clock of the test's own, with nodes that report once a second unless they are said not to."""

    def __init__(self, **limits: float) -> None:
        self.now = 100.0
        self.reports = dict.fromkeys(NODES, 0)
        self.events = 0
        self.watchdog = Watchdog(NODES, clock=lambda: self.now, **limits)

    def go(
        self,
        seconds: float,
        *,
        silent: Collection[str] = (),
        stopped: Collection[str] = (),
        idle: bool = False,
        step_s: float = 0.5,
    ) -> tuple[str, float]:
        """Look every half second; return what was said first and after how many seconds."""
        began = self.now
        while self.now - began < seconds:
            self.now += step_s
            for node in NODES:
                if node not in silent and node not in stopped:
                    self.reports[node] += 1
            self.events += not idle
            states = {node: "T" if node in stopped else "S" for node in NODES}
            if reason := self.watchdog.look(states, self.reports, self.events):
                return reason, self.now - began
        return "", seconds


@pytest.mark.parametrize("node", NODES)
def test_a_stopped_process_is_named_within_ten_seconds(node: str) -> None:
    run = Run()
    run.go(20.0)
    reason, seconds = run.go(60.0, stopped=[node])
    assert reason.startswith(f"node {node} was stopped")
    assert seconds < 10.0


def test_a_stopped_process_that_goes_on_soon_is_left_alone() -> None:
    run = Run()
    for _ in range(5):
        assert run.go(4.0, stopped=["/world"])[0] == ""
        assert run.go(2.0)[0] == ""


@pytest.mark.parametrize("node", NODES)
def test_a_silent_node_is_named_within_a_minute_while_others_report(node: str) -> None:
    run = Run()
    run.go(20.0)
    reason, seconds = run.go(100.0, silent=[node])
    assert reason.startswith(f"node {node} hangs")
    assert 30.0 < seconds < 60.0


def test_two_silent_nodes_are_found_as_long_as_a_third_reports() -> None:
    run = Run()
    run.go(5.0)
    assert "hangs" in run.go(100.0, silent=["/world", "/follower_1/predictor"])[0]


def test_half_a_minute_of_work_is_no_hang() -> None:
    run = Run()
    for _ in range(5):
        assert run.go(35.0, silent=["/follower_1/predictor"])[0] == ""
        assert run.go(1.0)[0] == ""


def test_a_node_that_still_loads_has_more_time() -> None:
    run = Run()
    reason, seconds = run.go(300.0, silent=["/world"])
    assert "/world hangs" in reason
    assert seconds > 100.0


def test_a_machine_on_which_nobody_gets_anywhere_condemns_nobody() -> None:
    run = Run()
    run.go(5.0)
    assert run.go(500.0, silent=NODES)[0] == ""


def test_a_run_in_which_nothing_happens_is_given_up() -> None:
    reason, seconds = Run(idle_s=90.0).go(500.0, idle=True)
    assert "no robot has done anything for 90 s" in reason
    assert 90.0 <= seconds < 92.0


def test_a_launcher_that_was_stopped_itself_condemns_nobody_when_it_goes_on() -> None:
    run = Run()
    run.go(20.0)
    # One look after an hour: what the others did meanwhile has not been read yet.
    assert run.go(3600.0, stopped=["/world"], silent=["/recorder"], idle=True, step_s=3600.0)[0] == ""
    assert run.go(20.0)[0] == ""


def test_it_asks_to_be_called_twice_a_second() -> None:
    run = Run()
    assert not run.watchdog.due
    run.now += 0.5
    assert run.watchdog.due
