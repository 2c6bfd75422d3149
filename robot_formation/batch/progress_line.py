"""How far a batch of work is, on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def with_progress(rows: Iterable[T], count: int, what: str = "runs") -> Iterator[T]:
    """Yield the rows; tell standard error how many there are, how fast they come and how long the rest will take."""
    began = last = time.monotonic()
    terminal = sys.stderr.isatty()
    for number, row in enumerate(rows, 1):
        yield row
        now = time.monotonic()
        if now - last < (0.5 if terminal else 10.0) and number < count:
            continue
        last = now
        rate = number / max(now - began, 1e-9)
        left = (count - number) / rate
        text = f"{number}/{count} {what}, {60.0 * rate:.0f} per minute, {_duration(left)} left"
        print(f"\r{text:<60}" if terminal else text, end="" if terminal and number < count else "\n", file=sys.stderr)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
