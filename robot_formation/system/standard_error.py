"""Standard error below Python: what C libraries print goes past sys.stderr."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import IO, Any

_STDERR = 2


@contextlib.contextmanager
def diverted_stderr(target: IO[Any]) -> Iterator[None]:
    """Divert the descriptor of standard error to an open file."""
    try:
        kept = os.dup(_STDERR)
    except OSError:  # it is closed, so that nothing can be printed
        yield
        return
    try:
        if sys.stderr is not None:
            sys.stderr.flush()
        os.dup2(target.fileno(), _STDERR)
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)


@contextlib.contextmanager
def silent_stderr() -> Iterator[None]:
    """Discard what is written to the descriptor of standard error."""
    with open(os.devnull, "w") as nowhere, diverted_stderr(nowhere):
        yield
