"""What the fine-tuner asks of a way to use the camera, and the decisions that it answers with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.vision.pixy2.block import Block

Frames = Sequence[Sequence[Block]]
"""The blocks of each frame of a look, in order."""


class Verdict(Enum):
    """What to do after a look."""

    MOVE = "move"
    LOOK = "look"
    SEARCH = "search"
    ALIGNED = "aligned"
    UNALIGNED = "unaligned"
    LOST = "lost"


@dataclass(frozen=True)
class Decision:
    """The verdict of a look, the motion that goes with MOVE and SEARCH, and the reason in words."""

    verdict: Verdict
    motion: Motion = Motion()
    reason: str = ""


class AlignmentMode(Protocol):
    """One follower's use of its camera, over all timesteps."""

    def restart(self, timestep: int, step: UncertainMotion | None = None) -> None:
        """Begin a timestep: the neighbour has made its step (timestep 0: nobody has moved yet).

        Args:
            timestep: its number.
            step: what that step is expected to do to the formation position, in that position's own frame; None if
                nothing is.
        """

    def neighbour_corrects(self) -> None:
        """The neighbour may have moved since the last look: it corrects at the same time."""

    def turn(self, forecast_rad: float) -> float:
        """Return the turn [rad] to make with the prediction move, of which so much was forecast."""

    def moved(self, asked: Motion, motion: Motion) -> None:
        """Process a move: as commanded, and as the encoder wheels measured it."""

    def assess(self, frames: Frames) -> Decision:
        """Decide what a look calls for."""

    def caught_up_rad(self) -> float:
        """Return the standard deviation [rad] of what the timestep's turn makes good of earlier ones."""

    def offset(self) -> UncertainMotion | None:
        """Estimate the way to the formation position after the last look; None if the look doesn't tell."""

    def ahead(self) -> UncertainMotion | None:
        """Estimate that way without a look, by forecast and measured moves; None if nothing is known."""
