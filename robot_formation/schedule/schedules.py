"""Schedules: who waits for whom before a timestep begins.

`turns` is the paper's: the leader drives, then every follower in turn, and the leader waits for all of them. In `wave`
a robot waits for its two neighbours only, so that several timesteps are under way along the chain; every look is still
at a standing robot. In `together` all robots move at the same time, then all look and correct. `timer` has no ticks at
all: everybody begins at the same times by the clock. The words of the literature on look-compute-move robots are SSYNC
for the first two, FSYNC for `together`, ASYNC for `timer`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot_formation.parameters import Choice, ParameterError, parameter

COLLECTION_TIMESTEPS = 3
"""Timesteps from which the predictor learns before its forecasts count (paper, fig. "algorithm scheme")."""
COLLECTION_PERIODS = 4
"""Periods that the first alignment and each timestep of the collection phase get, for there are corrections in them."""


class Schedule(Choice):
    """Who waits for whom."""

    TURNS = "turns"
    WAVE = "wave"
    TOGETHER = "together"
    TIMER = "timer"

    @property
    def at_once(self) -> bool:
        """Whether neighbours move at the same time, so that a look may be at a moving robot."""
        return self in (Schedule.TOGETHER, Schedule.TIMER)


class Spacing(Choice):
    """What a follower's place is: beside its neighbour, or beside where that stood one timestep earlier."""

    RIGID = "rigid"
    DELAYED = "delayed"


def period_parameter() -> Any:
    """Make the parameter of all nodes that need the period of `timer`; a step and a look take some three seconds."""
    text = "Period of the schedule timer; the first alignment and the collection phase take four per timestep"
    return parameter(4.0, text, unit="s", low=2.0, high=1000.0)


def check_spacing(schedule: Schedule, spacing: Spacing) -> None:
    """Check that a spacing can be kept.

    Raises:
        ParameterError: if robots that wait for each other are to lag behind.
    """
    if spacing is Spacing.DELAYED and not schedule.at_once:
        raise ParameterError(
            f"spacing 'delayed' needs a schedule in which robots move at the same time, not '{schedule}'; "
            "choose schedule together or timer, or spacing rigid"
        )


def begin_s(timestep: int, period_s: float) -> float:
    """Return when a timestep begins by `timer`, seconds after the start; the first alignment is timestep 0."""
    long = min(timestep, COLLECTION_TIMESTEPS + 1)
    return period_s * (COLLECTION_PERIODS * long + timestep - long)


def may_begin_in_wave(robot: int, robots: int, timestep: int, finished: Mapping[int, int]) -> bool:
    """Whether a robot may begin a timestep in `wave`.

    Args:
        robot: its number in the chain, 0 for the leader.
        robots: how many there are.
        timestep: what it would begin.
        finished: the latest timestep of each robot, by number, that is known to be finished.
    """
    left = robot == 0 or finished.get(robot - 1, -1) >= timestep
    right = robot == robots - 1 or timestep == 0 or finished.get(robot + 1, -1) >= timestep - 1
    return left and right
