"""What the fine-tuner asks of a way to use the camera, and the ways there are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from robot_formation.alignment.paper_rules import AlignmentParameters, Decision, PaperAlignment
from robot_formation.geometry.se2 import Motion
from robot_formation.vision.pixy2.block import Block

Frames = Sequence[Sequence[Block]]
"""The blocks of each frame of a look, in order."""


class AlignmentMode(Protocol):
    """One follower's use of its camera, over all timesteps."""

    def restart(self, timestep: int) -> None:
        """Begin a timestep: the neighbour has made its step (timestep 0: nobody has moved yet)."""

    def turn(self) -> float:
        """Tell the turn [rad] to make with the prediction move."""

    def moved(self, asked: Motion, motion: Motion) -> None:
        """Take a move as it was asked for, and as the encoder wheels measured it."""

    def assess(self, frames: Frames) -> Decision:
        """Decide what a look calls for."""

    def offset(self) -> Motion | None:
        """Estimate the way to the formation position after the last look; None if the look doesn't tell."""


class PaperMode:
    """`mode: paper` behind the protocol: every timestep is a new alignment, and only a look's last frame counts."""

    def __init__(self, parameters: AlignmentParameters) -> None:
        self._p = parameters
        self._alignment = PaperAlignment(parameters)
        self._blocks: Sequence[Block] = ()

    def restart(self, timestep: int) -> None:
        """See `AlignmentMode`."""
        self._alignment = PaperAlignment(self._p)

    def turn(self) -> float:
        """See `AlignmentMode`; the rule table leaves the heading alone."""
        return 0.0

    def moved(self, asked: Motion, motion: Motion) -> None:
        """See `AlignmentMode`; the rule table has no memory of moves."""

    def assess(self, frames: Frames) -> Decision:
        """See `AlignmentMode`."""
        self._blocks = frames[-1]
        return self._alignment.assess(self._blocks)

    def offset(self) -> Motion | None:
        """See `AlignmentMode`."""
        return self._alignment.offset(self._blocks)
