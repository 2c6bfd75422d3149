"""What the end of a node says of its run, and how a launched run ends: decisions only, no processes."""

from __future__ import annotations

import signal
from dataclasses import dataclass, field

from robot_formation import exit_codes
from robot_formation.names import ONLOOKERS, PROGRESS, RECORDER

_MISSING = "a node that was to be started elsewhere is missing or gone: progress has said which"
_WORDS = {exit_codes.DONE: "done", exit_codes.LOST: "lost", exit_codes.INTERRUPTED: "interrupted"}


def verdict(executable: str, code: int) -> int:
    """Return a run's exit code from that of the node that ended first (negative: the signal that killed it)."""
    if code == exit_codes.DONE and executable == "leader":
        return exit_codes.DONE
    if code == exit_codes.LOST and executable in ("fine_tuner", "world"):
        return exit_codes.LOST
    return exit_codes.BAD_INPUT if code == exit_codes.BAD_INPUT else exit_codes.NODE_DIED


def recorder_failed(executable: str, code: int | None) -> bool:
    """Return whether a node is a recorder that did not end well (None: not at all).

    It has work to do after the run's end: without its bag the run has not been what was asked for.
    """
    return executable == RECORDER and code != exit_codes.DONE


def holds_still(executable: str, code: int | None) -> bool:
    """Return whether a node is the fine-tuner of a follower that has lost its neighbour."""
    return executable == "fine_tuner" and code == exit_codes.LOST


def misses_stand_in(executable: str, code: int | None) -> bool:
    """Return whether a node is the progress of a launched run, and says that a node started elsewhere is missing."""
    return executable == PROGRESS and code == exit_codes.NODE_DIED


def manner(code: int) -> str:
    """Describe how a process ended."""
    return f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


@dataclass
class LaunchedRun:
    """Follows the ends of a run's processes.

    Attributes:
        processes: how many there are.
        bag: where the recorder writes, for people; empty: nowhere.
        exit_code: of the run, None until something has ended it.
        reason: why it did not end well; empty if it did.
    """

    processes: int
    bag: str = ""
    exit_code: int | None = field(default=None, init=False)
    reason: str = field(default="", init=False)
    _ended: int = field(default=0, init=False)

    def ended(self, name: str, executable: str, code: int, *, stopping: bool) -> bool:
        """Register a process's end; return whether the run ends with it, so that its others have to end too.

        Args:
            name: the node's, for people.
            executable: what ran.
            code: its exit code.
            stopping: whether everything that was launched had been told to end.
        """
        self._ended += 1
        if executable in ONLOOKERS and not misses_stand_in(executable, code):
            return False  # nothing of the run needs it
        first = self.exit_code is None
        if first:
            self.exit_code = exit_codes.INTERRUPTED if stopping else verdict(executable, code)
            if self.exit_code not in (exit_codes.DONE, exit_codes.INTERRUPTED):
                missing = misses_stand_in(executable, code)
                self.reason = _MISSING if missing else f"{name} {manner(code)}"
        if holds_still(executable, code) and self.exit_code == exit_codes.DONE:
            self.exit_code, self.reason = exit_codes.LOST, f"{name} {manner(code)}"
        if recorder_failed(executable, code) and self.exit_code in _WORDS:
            self.exit_code, self.reason = exit_codes.NODE_DIED, f"{name} {manner(code)}"
        return first and not stopping

    @property
    def complete(self) -> bool:
        """Whether all processes have ended."""
        return self._ended == self.processes

    @property
    def failed(self) -> bool:
        """Whether the run has ended and must count as failed: its leader was lost, or a node died."""
        return self.complete and self.exit_code not in (exit_codes.DONE, exit_codes.INTERRUPTED)

    def __str__(self) -> str:
        """Describe how the run ended, in one line."""
        word = _WORDS.get(exit_codes.NODE_DIED if self.exit_code is None else self.exit_code, "incomplete")
        why = f" ({self.reason})" if self.reason else ""
        return f"outcome: {word}{why}" + (f", bag {self.bag}" if self.bag else "")
