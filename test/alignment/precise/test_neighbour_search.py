"""What a follower does when looks don't show its neighbour: hold, go back, turn to both sides, step, give up."""

import math
from collections.abc import Sequence

import pytest

from robot_formation.alignment.mode import Decision, Verdict
from robot_formation.alignment.precise.neighbour_search import NeighbourSearch, SearchParameters
from robot_formation.geometry.se2 import Motion

P = SearchParameters()
LAST = Motion(0.04, -0.02, 0.1)
EXPECTED = Motion(0.3, 0.4, 0.2)


def decisions(search: NeighbourSearch, last: Motion = LAST, expected: Motion | None = EXPECTED) -> list[Decision]:
    """All decisions of looks in vain, to the end."""
    found = [search.missed(last, expected)]
    while found[-1].verdict is not Verdict.LOST:
        found.append(search.missed(last, expected))
    return found


def moves(found: Sequence[Decision]) -> list[Motion]:
    return [decision.motion for decision in found if decision.verdict is Verdict.SEARCH]


def test_it_looks_again_from_the_same_place_before_it_moves() -> None:
    found = decisions(NeighbourSearch(P))
    assert [decision.verdict for decision in found[: P.hold_looks]] == [Verdict.LOOK] * (P.hold_looks - 1) + [
        Verdict.SEARCH
    ]


def test_the_first_move_takes_the_last_correction_back() -> None:
    back = LAST.then(moves(decisions(NeighbourSearch(P)))[0])
    assert (back.x_m, back.y_m, back.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_without_a_correction_there_is_nothing_to_take_back() -> None:
    first, *_ = moves(decisions(NeighbourSearch(P), last=Motion()))
    assert first == Motion(yaw_rad=P.turn_rad)


def test_the_turns_go_to_both_sides_and_end_where_they_began() -> None:
    _, *rest = moves(decisions(NeighbourSearch(P), expected=None))
    turns = [motion.yaw_rad for motion in rest]
    assert len(turns) == 3 * P.rounds
    assert max(turns) > 0.0 > min(turns)
    assert math.fsum(turns) == pytest.approx(0.0, abs=1e-12)
    assert all((motion.x_m, motion.y_m) == (0.0, 0.0) for motion in rest)


@pytest.mark.parametrize("expected", [EXPECTED, Motion(0.01, 0.0, 0.0), Motion()])
def test_one_step_of_bounded_length_leads_towards_where_it_is_expected(expected: Motion) -> None:
    steps = [m for m in moves(decisions(NeighbourSearch(P), expected=expected))[1:] if m.yaw_rad == 0.0]
    length = math.hypot(expected.x_m, expected.y_m)
    assert len(steps) == (length > 0.0)
    for step in steps:
        assert math.hypot(step.x_m, step.y_m) == pytest.approx(min(P.max_step_m, length))
        assert step.x_m * expected.y_m == pytest.approx(step.y_m * expected.x_m)


def test_it_gives_up_after_a_bound_and_says_after_how_many_looks() -> None:
    found = decisions(NeighbourSearch(P))
    assert found[-1].reason == f"not found again in {len(found)} looks"


def test_a_neighbour_that_was_found_begins_a_new_search_when_it_is_lost_again() -> None:
    search = NeighbourSearch(P)
    first = decisions(search)
    search.found()
    assert decisions(search) == first
