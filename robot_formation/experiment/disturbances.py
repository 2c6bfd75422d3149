"""What a scenario does to its robots: closed cameras and pushes, as rows of a YAML list."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_formation.errors import shown
from robot_formation.follower.blind_driving import blind_timesteps
from robot_formation.parameters import ParameterError, suggestion
from robot_formation.world.pushes import Push, read_push

_LAST_TIMESTEP = 1_000_000  # a longer list would fill the memory
Row = Sequence[int | float | str]


def blackouts_of(rows: Sequence[Row], robots: Sequence[str], robot: str = "") -> tuple[int, ...]:
    """List first timesteps and lengths of the blackouts of all followers, and of one follower's own, one after another.

    Args:
        rows: [first timestep, length] for all followers, [follower, first timestep, length] for one.
        robots: names of all robots, the leader first.
        robot: whose own are listed too; '': nobody's.

    Raises:
        ParameterError: naming the row that is no blackout, or overlaps another one.
    """
    found: list[int] = []
    for row in rows:
        own = len(row) == 3 and isinstance(row[0], str)
        numbers = [number for number in (row[1:] if own else row) if isinstance(number, int)]
        if len(numbers) != 2 or len(row) != 2 + own or max(numbers) > _LAST_TIMESTEP:
            raise ParameterError(
                f"'blackouts': {shown(list(row))} is no blackout; write [first timestep, length], "
                "or [follower_2, first timestep, length] for one follower"
            )
        if own and row[0] not in robots[1:]:
            raise ParameterError(f"'blackouts': no follower '{row[0]}'{suggestion(str(row[0]), robots[1:])}")
        if not own or row[0] == robot:
            found += numbers
    blind_timesteps(found, "'blackouts'")
    return tuple(found)


def pushes_of(rows: Sequence[Row]) -> tuple[Push, ...]:
    """Read pushes: rows of robot, timestep, and displacement ahead and to the left in metres.

    Raises:
        ParameterError: naming the row that is no push.
    """
    return tuple(_push(row) for row in rows)


def _finite(number: object) -> bool:
    return isinstance(number, (int, float)) and math.isfinite(number)


def _push(row: Row) -> Push:
    named = len(row) == 4 and isinstance(row[0], str) and isinstance(row[1], int)
    if not named or not all(map(_finite, row[2:])):
        raise ParameterError(
            f"'pushes': {shown(list(row))} is no push; write [robot, timestep, metres ahead, metres to the left], "
            "like [follower_2, 8, 0.03, 0.0]"
        )
    return read_push(" ".join(map(str, row)), "'pushes'")
