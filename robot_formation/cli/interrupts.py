"""Ends the command line's process quietly: interrupts at any moment, a closed terminal, closed standard streams.

Imports hardly more than what Python has loaded already, since it has to be at work before anything else is imported.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
import time
from types import FrameType
from typing import Any

from robot_formation.system import signal_handling

_INTERRUPTED = 130
_IMPATIENT_S = 2.0
_AGAIN_S = 0.01
# What writing to a terminal that was closed, or to a stream that nobody reads, is refused with.
_GONE = ("EIO", "EPIPE", "EBADF", "ENXIO")


class Interrupts:
    """Turns SIGINT, SIGTERM and SIGHUP into a KeyboardInterrupt, once: what ends in good order is not disturbed again.

    SIGHUP stays ignored where it is (nohup). A signal that comes `_IMPATIENT_S` later or after that ends the process
    at once.

    Attributes:
        came: whether a signal has come.
    """

    def __init__(self) -> None:
        self.came = False
        self._first_s = 0.0
        self._leaving: int | None = None

    def install(self) -> None:
        """Handle the signals from now on; those that were blocked before (by ./formation) come now."""
        signal_handling.take(self._take)
        sys.unraisablehook = self._unraisable
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signal_handling.ENDING)

    def leave(self, code: int) -> None:
        """From now on a signal ends the process at once with this exit code: only Python's own end is left to do."""
        self._leaving = code
        # An interrupt that was to be raised again: Python's end lets go of the handlers, and SIGALRM would kill.
        signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self._leaving is not None:
            os._exit(self._leaving)
        now = time.monotonic()
        if not self.came:
            self.came, self._first_s = True, now
            raise KeyboardInterrupt
        if now - self._first_s > _IMPATIENT_S:
            os._exit(_INTERRUPTED)

    def _unraisable(self, unraisable: Any) -> None:
        """Raise an interrupt again that hit where Python can't raise: in a destructor or a callback of C code."""
        if self.came and isinstance(unraisable.exc_value, KeyboardInterrupt):
            # A moment later, since nothing can be raised in here either.
            signal.signal(signal.SIGALRM, self._raise_again)
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
        else:
            sys.__unraisablehook__(unraisable)

    def _raise_again(self, number: int, frame: FrameType | None) -> None:
        if self._leaving is None:
            raise KeyboardInterrupt


class _Stream(io.FileIO):
    """A standard stream that swallows what can't be written any more, because its terminal was closed."""

    def __init__(self, descriptor: int, gone: tuple[str, ...]) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._gone = {getattr(errno, name) for name in gone}

    def write(self, data: Any, /) -> int:
        """Write, or take for written what nobody can read."""
        try:
            return super().write(data) or 0
        except OSError as error:
            if error.errno not in self._gone:
                raise
            return len(data)


def guard_streams() -> None:
    """Make the standard streams safe to write to, closed ones and those of a terminal that is closed later.

    A closed descriptor is opened on /dev/null: else the next file that is opened gets its number, and what is meant for
    the terminal goes into that file. A pipe whose reader has gone still raises BrokenPipeError on standard output.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number
    sys.stdin = sys.stdin or open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - as long as the process
    sys.stdout = _wrapped(sys.stdout, 1, tuple(name for name in _GONE if name != "EPIPE"))
    sys.stderr = _wrapped(sys.stderr, 2, _GONE)


def _wrapped(stream: Any, descriptor: int, gone: tuple[str, ...]) -> io.TextIOWrapper:
    if stream is not None:
        stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_Stream(descriptor, gone)),
        encoding=stream.encoding if stream is not None else "utf-8",
        errors=stream.errors if stream is not None else "backslashreplace",
        line_buffering=descriptor == 2 or os.isatty(descriptor) or bool(os.environ.get("PYTHONUNBUFFERED")),
    )


def flush_or_forget_output() -> None:
    """Write what is left of standard output, or forget it where it can't be written (a full disk)."""
    try:
        sys.stdout.flush()
    except OSError:
        forget_output()


def forget_output() -> None:
    """Send the rest of standard output nowhere: its reader (head, less) has gone, and Python would complain at exit."""
    with contextlib.suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
