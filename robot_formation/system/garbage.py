"""Python's collector of garbage in cycles."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

_NEW_OBJECTS = 200_000


@contextmanager
def rare_collections() -> Iterator[None]:
    """Collect seldom in this process: after 200 000 new objects, not 700, or as seldom as the caller has chosen.

    For work that makes hardly any garbage in cycles: each full collection looks at all objects of the process, which
    takes 12 ms where numpy, OpenCV and the message packages are loaded.
    """
    before = gc.get_threshold()
    if before[0]:  # 0: the caller has switched collections off
        gc.set_threshold(max(before[0], _NEW_OBJECTS), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
