"""What the leader of a recorded run was told to drive, as a file that `waypoints` replays to the last bit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from robot_formation import names
from robot_formation.analysis.errors import AnalysisError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.reader import read_bag
from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.waypoint_file import MOTIONS

_NEAR = 16
"""Neighbouring floating-point numbers that are tried on either side of a yaw."""


def load_leader_moves(path: str | Path, namespace: str | None = None) -> list[Motion]:
    """Read the leader's moves, one per timestep.

    Args:
        path: the bag.
        namespace: where the formation lies in it, '/' for the root; None: wherever there is one.

    Raises:
        BagError: the bag is missing, no bag, empty or corrupted, or holds several formations.
        AnalysisError: the bag has no moves of a leader.
    """
    topic = names.MOVE.of(names.LEADER)
    with read_bag(path) as opened:
        bag = FormationBag(opened, namespace)
        if topic not in bag.topics:
            raise AnalysisError(f"{path} has no messages on '{topic}': no leader was recorded in it")
        bag.require({topic: names.MOVE.type})
        poses = [found.message.pose for found in bag.messages([topic])]
    return [Motion(p.position.x, p.position.y, _yaw(p.orientation.z, p.orientation.w)) for p in poses]


def waypoint_text(moves: Iterable[Motion]) -> str:
    """Return moves as the text of a waypoint file, every digit that they have."""
    lines = [",".join(MOTIONS)]
    lines += [",".join(repr(float(part)) for part in (move.x_m, move.y_m, move.yaw_rad)) for move in moves]
    return "\n".join(lines) + "\n"


def _yaw(sine: float, cosine: float) -> float:
    """Return the yaw of which these are sine and cosine of the half, to the last bit if any near one has them."""
    yaw = 2.0 * math.atan2(sine, cosine)
    below = above = yaw
    for _ in range(_NEAR):
        for candidate in (below, above):
            if (math.sin(candidate / 2.0), math.cos(candidate / 2.0)) == (sine, cosine):
                return candidate
        below, above = math.nextafter(below, -math.inf), math.nextafter(above, math.inf)
    return yaw
