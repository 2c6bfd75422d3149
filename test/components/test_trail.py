"""Paths for viewers: the whole drive in a bounded number of poses, and few enough messages."""

import itertools
import math

import pytest

from robot_formation.components.trail import MOST_POSES, SPACING_M, Trail

STEP_M = 0.05


Point = tuple[float, float, float]


def drive(steps: int, rests: int = 5) -> tuple[list[list[Point]], list[Point]]:
    """Poses of a robot on a circle that corrects each step by some millimetres; the sizes of the paths sent."""
    trail: Trail[Point] = Trail()
    sent: list[list[Point]] = []
    places: list[Point] = []
    for step in range(steps):
        for rest in range(rests):
            angle = (step * STEP_M + rest * 0.002) / 1.0
            places.append((math.cos(angle), math.sin(angle), 0.0))
            path = trail.add(places[-1], places[-1])
            if path is not None:
                sent.append(path)
    return sent, places


def test_what_is_sent_per_timestep_does_not_grow() -> None:
    def poses(steps: int) -> float:
        return sum(map(len, drive(steps)[0])) / steps

    assert poses(100) < 45
    assert max(poses(steps) for steps in (200, 400, 1000, 4000, 20_000)) < 45


def test_a_short_drive_is_sent_pose_by_pose() -> None:
    sent, places = drive(30, rests=1)
    assert sent == [places[: n + 1] for n in range(30)]


@pytest.mark.parametrize("steps", [30, 400, 4000])
def test_the_whole_drive_stays_visible(steps: int) -> None:
    sent, places = drive(steps)
    assert all(len(path) <= MOST_POSES for path in sent)
    last = sent[-1]
    assert last[0] == places[0]
    gaps = [math.dist(a, b) for a, b in itertools.pairwise(last)]
    doubled = 2.0 ** max(0, math.ceil(math.log2(steps / (MOST_POSES / 2))))
    assert max(gaps) < 2.0 * max(STEP_M, SPACING_M) * doubled
    behind = len(places) - 1 - places.index(last[-1])
    assert behind <= 5 * steps / 25 + 5


def test_a_robot_that_turns_on_the_spot_sends_nothing() -> None:
    trail: Trail[str] = Trail()
    assert trail.add((1.0, 2.0, 0.0), "a") == ["a"]
    assert trail.add((1.0, 2.0, 0.0), "b") is None
