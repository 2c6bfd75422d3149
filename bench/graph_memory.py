"""Proportional set sizes of a run's processes: of a page that several processes share, each counts its part."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_TITLE = re.compile(r"robot_formation (?P<executable>\w+) .*__ns:=(?P<namespace>\S+)")


def descendants(pid: int) -> Iterator[int]:
    """Yield a process's children and theirs."""
    children: list[int] = []
    with suppress(OSError):  # the process has ended
        for task in Path(f"/proc/{pid}/task").glob("*/children"):
            with suppress(OSError):  # the thread has ended
                children += map(int, task.read_text(encoding="ascii").split())
    for child in children:
        yield child
        yield from descendants(child)


def set_size_mb(pid: int) -> float:
    """Return the proportional set size of a process; 0 if it has ended."""
    with suppress(OSError):
        text = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
        if found := re.search(r"^Pss:\s+(\d+) kB", text, re.MULTILINE):
            return int(found[1]) / 1e3
    return 0.0


def nodes_mb() -> dict[str, float]:
    """Return the sizes of all processes that this one has started: of nodes by full name, of others by number."""
    sizes = {pid: set_size_mb(pid) for pid in set(descendants(os.getpid()))}
    return {_name(pid): size for pid, size in sizes.items()}


def graph_mb() -> float:
    """Return the sum of the sizes of all processes that this one has started."""
    return sum(nodes_mb().values())


def _name(pid: int) -> str:
    with suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8", errors="replace").replace("\0", " ")
        if match := _TITLE.match(words):
            return f"{match['namespace'].rstrip('/')}/{match['executable']}"
    return str(pid)
