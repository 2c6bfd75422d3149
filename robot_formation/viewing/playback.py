"""Where a playback is in a recorded run: time, speed, pauses and steps, without a clock of its own."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence


class Playback:
    """Goes through a run, and begins again at its end.

    Args:
        start_ns: simulated time at which the run begins.
        end_ns: and ends.
        stops_ns: where steps lead to, in any order: the ends of timesteps.

    Attributes:
        now_ns: simulated time.
        playing: whether it goes on by itself.
        speed: simulated seconds per second.
    """

    def __init__(self, start_ns: int, end_ns: int, stops_ns: Sequence[int]) -> None:
        self._start_ns, self._end_ns = start_ns, max(start_ns, end_ns)
        self._stops_ns = sorted({stop for stop in stops_ns if start_ns < stop < end_ns} | {self._end_ns})
        self.now_ns = start_ns
        self.playing = True
        self.speed = 1.0

    @property
    def duration_s(self) -> float:
        """Simulated seconds from the beginning to the end."""
        return (self._end_ns - self._start_ns) * 1e-9

    @property
    def now_s(self) -> float:
        """Simulated seconds since the beginning."""
        return (self.now_ns - self._start_ns) * 1e-9

    def elapse(self, wall_s: float) -> None:
        """Let wall time pass."""
        if not self.playing:
            return
        if self.now_ns >= self._end_ns:
            self.now_ns = self._start_ns
        else:
            self.now_ns = min(self._end_ns, self.now_ns + round(wall_s * self.speed * 1e9))

    def seek(self, second: float) -> None:
        """Go to a time after the beginning, seconds, and pause there."""
        self.playing = False
        self.now_ns = min(self._end_ns, max(self._start_ns, self._start_ns + round(second * 1e9)))

    def step(self) -> None:
        """Go to the next stop, from the end to the first one, and pause there."""
        self.playing = False
        index = bisect_right(self._stops_ns, self.now_ns)
        self.now_ns = self._stops_ns[index % len(self._stops_ns)]
