"""How a run ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robot_formation.errors import FormationError


class RunError(FormationError):
    """A run can't go on."""


def joined_reasons(held: Sequence[str], ended: str) -> str:
    """Say why a run ended: what robots that hold still have said, then what has ended it, if that says more."""
    return "; ".join([*held, *([ended] if ended and ended not in held else [])])


@dataclass
class NodeUsage:
    """What a node cost: processor seconds and peak resident memory."""

    processor_s: float
    peak_memory_mb: float


@dataclass
class RunResult:
    """How a run ended: exit code (see exit_codes), the reason if there is one, the bag and the costs.

    Wall time is told apart: until the first sign of life from a robot, from there to the run's end, and what ending the
    nodes in good order took. A run in one process only has the middle part.
    """

    exit_code: int
    bag: Path | None = None
    reason: str = ""
    warnings: list[str] = field(default_factory=list)
    startup_s: float = 0.0
    running_s: float = 0.0
    stopping_s: float = 0.0
    usage: dict[str, NodeUsage] = field(default_factory=dict)
