"""How a launched run ends, told from the ends of its nodes."""

import pytest

from robot_formation import exit_codes
from robot_formation.launching.outcome import LaunchedRun, verdict


@pytest.mark.parametrize(
    ("executable", "code", "expected"),
    [
        ("leader", 0, exit_codes.DONE),
        ("drive", 0, exit_codes.NODE_DIED),
        ("fine_tuner", 3, exit_codes.LOST),
        ("world", 3, exit_codes.LOST),
        ("leader", 3, exit_codes.NODE_DIED),
        ("recorder", 2, exit_codes.BAD_INPUT),
        ("world", -9, exit_codes.NODE_DIED),
        ("world", 1, exit_codes.NODE_DIED),
    ],
)
def test_the_node_that_ends_first_says_how_the_run_ends(executable: str, code: int, expected: int) -> None:
    assert verdict(executable, code) == expected


def ended(*ends: tuple[str, int], processes: int = 3, stopping: bool = False) -> tuple[LaunchedRun, list[bool]]:
    run = LaunchedRun(processes, "my_bag")
    firsts = [run.ended(f"/{name}", name, code, stopping=stopping) for name, code in ends]
    return run, firsts


def test_only_the_first_end_asks_the_others_to_end() -> None:
    run, firsts = ended(("leader", 0), ("world", 0), ("recorder", 0))
    assert firsts == [True, False, False]
    assert (run.complete, run.failed, str(run)) == (True, False, "outcome: done, bag my_bag")


def test_a_run_whose_recorder_fails_at_the_end_has_failed() -> None:
    run, _ = ended(("leader", 0), ("world", 0), ("recorder", 1))
    assert run.failed
    assert str(run) == "outcome: incomplete (/recorder ended with exit code 1), bag my_bag"


def test_nodes_that_are_made_to_end_do_not_change_the_outcome() -> None:
    run, _ = ended(("fine_tuner", 3), ("world", -15), ("drive", 0))
    assert str(run) == "outcome: lost (/fine_tuner ended with exit code 3), bag my_bag"


def test_an_interrupted_run_has_not_failed() -> None:
    run, firsts = ended(("world", 0), ("drive", -2), ("leader", 0), stopping=True)
    assert firsts == [False, False, False]
    assert (run.failed, str(run)) == (False, "outcome: interrupted, bag my_bag")


def test_a_run_that_goes_on_has_not_failed() -> None:
    run, _ = ended(("world", -9))
    assert (run.complete, run.failed) == (False, False)


def test_the_end_of_the_node_that_tells_the_progress_is_no_end_of_the_run() -> None:
    run, firsts = ended(("progress", -9), ("leader", 0), ("world", 0))
    assert firsts == [False, True, False]
    assert (run.complete, run.failed, str(run)) == (True, False, "outcome: done, bag my_bag")


def test_a_follower_that_held_still_makes_a_lost_run_of_one_that_the_leader_ended() -> None:
    run = LaunchedRun(2, "my_bag")
    assert run.ended("/leader/leader", "leader", 0, stopping=False)
    assert not run.ended("/follower_1/fine_tuner", "fine_tuner", 3, stopping=True)
    assert run.exit_code == 3
    assert run.failed
    assert str(run) == "outcome: lost (/follower_1/fine_tuner ended with exit code 3), bag my_bag"


def test_a_node_started_elsewhere_that_is_missing_ends_the_run() -> None:
    run, firsts = ended(("progress", 4), ("leader", 0), ("world", 0))
    assert firsts == [True, False, False]
    assert run.failed
    missing = "a node that was to be started elsewhere is missing or gone: progress has said which"
    assert str(run) == f"outcome: incomplete ({missing}), bag my_bag"
