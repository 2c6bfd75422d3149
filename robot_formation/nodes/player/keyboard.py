"""Single keys from the terminal, without waiting for Enter."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import tty
from types import TracebackType
from typing import IO, Any

_NAMES = {" ": "space", "\x1b[C": "right", "\x1bOC": "right"}
_ESCAPE = "\x1b"


class Keyboard:
    """Reads keys if a stream is the terminal of this process's foreground group; a context manager, which puts the
    terminal back as it was.

    Args:
        stream: where keys come from; by default standard input.
    """

    def __init__(self, stream: IO[Any] | None = None) -> None:
        self._stream = sys.stdin if stream is None else stream
        self._descriptor = -1
        self._before: list[Any] = []

    def __enter__(self) -> Keyboard:
        # Without a terminal, or in the background, there are no keys: reading would stop the process.
        with contextlib.suppress(OSError, ValueError, AttributeError, termios.error):
            descriptor = self._stream.fileno()
            if os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp():
                self._before = termios.tcgetattr(descriptor)
                tty.setcbreak(descriptor, termios.TCSADRAIN)
                self._descriptor = descriptor
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.attached:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)
            self._descriptor = -1

    @property
    def attached(self) -> bool:
        """Whether keys can come."""
        return self._descriptor >= 0

    def pressed(self) -> list[str]:
        """Return the keys pressed since the last time: `space`, `right` or a character."""
        if not self.attached or not select.select([self._descriptor], [], [], 0.0)[0]:
            return []
        text = os.read(self._descriptor, 1024).decode(errors="replace")
        found = []
        while text:
            # An arrow key is an escape character and two more.
            size = 3 if text.startswith(_ESCAPE) and len(text) >= 3 else 1
            found.append(_NAMES.get(text[:size], text[:size]))
            text = text[size:]
        return found
