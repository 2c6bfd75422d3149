"""States of a follower's alignment: what `alignment` publishes, bags hold and the analysis reads."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class AlignmentState(Enum):
    """One word per state; a reason may follow."""

    ALIGN = "align"
    """The initial alignment begins."""
    COLLECT = "collect"
    """A timestep of the collection phase begins with its first move."""
    PREDICT = "predict"
    """A timestep begins with its prediction move."""
    BLIND = "blind"
    """The prediction move of a timestep without the camera is sent: it is the timestep's only one."""
    CORRECT = "correct"
    """A correction is sent."""
    HOLD = "hold"
    """A look showed no neighbour: another one from the same place."""
    SEARCH = "search"
    """The neighbour is out of view: a move of the search is sent."""
    REACQUIRED = "reacquired"
    """The neighbour is in view again."""
    ALIGNED = "aligned"
    """The tolerances are met: the timestep's corrections are over."""
    UNALIGNED = "unaligned"
    """The corrections are used up before the tolerances were met."""
    LOST = "lost"
    """The neighbour was not found again."""

    @property
    def begins(self) -> bool:
        """Whether a timestep, or the initial alignment, begins with it."""
        return self in (AlignmentState.ALIGN, AlignmentState.COLLECT, AlignmentState.PREDICT)

    @property
    def opens_timestep(self) -> bool:
        """Whether a timestep begins with it."""
        return self.begins and self is not AlignmentState.ALIGN

    @property
    def corrects(self) -> bool:
        """Whether a move after the prediction move goes with it."""
        return self in (AlignmentState.CORRECT, AlignmentState.SEARCH)

    @property
    def sends_move(self) -> bool:
        """Whether a move goes with it."""
        return self.opens_timestep or self.corrects

    def format(self, reason: str = "") -> str:
        """Return the text of the topic: the state, and the reason after a colon."""
        return f"{self.value}: {reason}" if reason else self.value

    @classmethod
    def parse(cls, text: str) -> AlignmentState | None:
        """Return the state of a text of the topic; None for a word that is no state."""
        word = text.split(":")[0]
        return cls(word) if word in cls._value2member_map_ else None


@dataclass(frozen=True)
class State:
    """A state with its reason: an action of the fine-tuner."""

    state: AlignmentState
    reason: str = ""

    @property
    def text(self) -> str:
        """The text of the topic."""
        return self.state.format(self.reason)
