"""The fastest of some calls: the one that other work on the machine disturbed least."""

from __future__ import annotations

import time
from collections.abc import Callable


def fastest_ms(call: Callable[[], object], calls: int) -> float:
    """Fastest of some calls, milliseconds."""
    best = float("inf")
    for _ in range(calls):
        begin = time.perf_counter_ns()
        call()
        best = min(best, time.perf_counter_ns() - begin)
    return best / 1e6
