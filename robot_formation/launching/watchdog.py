"""Finds the node that hangs: stopped by a signal, silent while others report, or all of them without an event."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping

STOPPED = "T"
"""State of a process that SIGSTOP (or the terminal) has stopped, as /proc tells it. One held by a debugger has 't'."""

_EVERY_S = 0.5
_LONGEST_STEP_S = 1.0
_RECENT_S = 4.0


class Watchdog:
    """Counts, for each node, the time for which it was seen hanging.

    The time counts only while this process watches: of the time between two looks at most a second does, so that a
    launcher which was stopped itself (Ctrl-Z, a machine put to sleep) condemns nobody when it goes on. A node's silence
    counts only while another one is heard, so that a machine on which nobody gets anywhere is no reason either.

    Args:
        nodes: full names of the nodes.
        stopped_s: how long a process may be stopped.
        silent_s: how long a node may be silent on /diagnostics, where each reports once a second by the wall clock.
        starting_s: the same for one that has not been heard yet: it may still be loading.
        idle_s: how long no robot may do anything.
        clock: wall seconds from any origin.
    """

    def __init__(
        self,
        nodes: Iterable[str],
        *,
        stopped_s: float = 6.0,
        silent_s: float = 45.0,
        starting_s: float = 120.0,
        idle_s: float = 90.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._limits = {"stopped": stopped_s, "silent": silent_s, "starting": starting_s, "idle": idle_s}
        self._clock = clock
        self._looked_at = clock()
        self._stopped = dict.fromkeys(nodes, 0.0)
        self._silent = dict.fromkeys(self._stopped, 0.0)
        self._since_report = dict.fromkeys(self._stopped, float("inf"))
        self._reports = dict.fromkeys(self._stopped, 0)
        self._idle = 0.0
        self._events = 0

    @property
    def due(self) -> bool:
        """Whether it is time to look again."""
        return self._clock() - self._looked_at >= _EVERY_S

    def look(self, states: Mapping[str, str], reports: Mapping[str, int], events: int) -> str:
        """Update with the state of the nodes; return the name of one that hangs, with the reason, or an empty text.

        Args:
            states: of each node's process, the letter of /proc/PID/stat.
            reports: how often each node has reported on /diagnostics so far.
            events: how often a robot has done anything so far.
        """
        now = self._clock()
        step_s = min(now - self._looked_at, _LONGEST_STEP_S)
        self._looked_at = now
        self._idle = 0.0 if events != self._events else self._idle + step_s
        self._events = events
        self._listen(reports, step_s)
        for node in self._stopped:
            if reason := self._hangs(node, states.get(node, ""), step_s):
                return reason
        if self._idle > self._limits["idle"]:
            return f"no robot has done anything for {self._limits['idle']:.0f} s, though no node's process has ended"
        return ""

    def _listen(self, reports: Mapping[str, int], step_s: float) -> None:
        for node, before in self._reports.items():
            count = reports.get(node, 0)
            self._since_report[node] = 0.0 if count != before else self._since_report[node] + step_s
            self._reports[node] = count

    def _hangs(self, node: str, state: str, step_s: float) -> str:
        self._stopped[node] = self._stopped[node] + step_s if state == STOPPED else 0.0
        if self._stopped[node] > self._limits["stopped"]:
            return stopped_text(node, self._stopped[node])
        others = min((age for other, age in self._since_report.items() if other != node), default=float("inf"))
        if self._since_report[node] == 0.0:
            self._silent[node] = 0.0
        elif others < _RECENT_S:
            self._silent[node] += step_s
        limit_s = self._limits["silent" if self._reports[node] else "starting"]
        if self._silent[node] > limit_s:
            return f"node {node} hangs: it has not reported on /diagnostics for {limit_s:.0f} s, while others have"
        return ""


def stopped_text(node: str, seconds: float | None = None) -> str:
    """Return the text that a node's process is stopped."""
    since = "" if seconds is None else f" for {seconds:.0f} s"
    return f"node {node} was stopped{since} (process state {STOPPED}: SIGSTOP or the like)"
