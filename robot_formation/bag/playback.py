"""Playing a bag: which message is due when. No clock is read here; wall times are arguments, in seconds."""

from __future__ import annotations

import math
import threading
from array import array
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from queue import Full, Queue
from types import TracebackType

import numpy as np

from robot_formation.bag.errors import BagError
from robot_formation.bag.reader import Bag
from robot_formation.bag.source import RawMessage

_BATCH = 64
_BATCHES = 32
_BATCH_BYTES = 1 << 20
_PATIENCE_S = 0.1


@dataclass(frozen=True)
class Excerpt:
    """A part of a bag: topics and log times.

    Attributes:
        topics: names of the topics.
        latched: those of them that are transient local, with how many messages they hold for late subscribers (0:
            all): what they hold at the beginning is sent first.
        start_ns: log time of the beginning.
        stop_ns: log time of the end, which doesn't belong to it.
    """

    topics: frozenset[str]
    latched: Mapping[str, int]
    start_ns: int
    stop_ns: int

    def first(self, bag: Bag) -> Iterator[RawMessage]:
        """Yield what late subscribers of the transient-local topics would know at the beginning."""
        before = list(bag.raw_messages(self.latched, None, self.start_ns))
        later = Counter(message.topic for message in before)
        for message in before:
            later[message.topic] -= 1
            depth = self.latched[message.topic]
            if depth == 0 or later[message.topic] < depth:
                yield message
        yield from bag.raw_messages(self.latched, self.start_ns, self.start_ns + 1)

    def scheduled(self, bag: Bag) -> Iterator[RawMessage]:
        """Yield the other messages in the order of their log times."""
        for message in bag.raw_messages(self.topics, self.start_ns, self.stop_ns):
            if message.topic not in self.latched or message.stamp_ns > self.start_ns:
                yield message


def make_excerpt(
    bag: Bag, topics: frozenset[str], latched: Mapping[str, int], start_s: float = 0.0, duration_s: float = 0.0
) -> Excerpt:
    """Cut a part out of a bag.

    Args:
        bag: an open bag.
        topics: names of the topics.
        latched: the transient-local ones among them, with their depths (0: all).
        start_s: seconds from the bag's first message to the beginning.
        duration_s: seconds from the beginning to the end; 0: to the bag's end.

    Raises:
        BagError: the beginning is behind the bag's end.
    """
    if start_s > bag.duration_s:
        raise BagError(f"{bag.path} is {bag.duration_s:.3f} s long: it can't be played from {start_s:g} s on")
    start_ns = bag.start_ns + round(start_s * 1e9)
    stop_ns = start_ns + round(duration_s * 1e9) if duration_s > 0.0 else bag.end_ns + 1
    return Excerpt(topics, latched, start_ns, stop_ns)


class Playhead:
    """Ties bag time to wall time at a rate, with pauses.

    Args:
        rate: bag seconds per wall second, more than 0.
        start_ns: bag time at the beginning.
        now_s: wall time at the beginning.
    """

    def __init__(self, rate: float, start_ns: int, now_s: float) -> None:
        self._rate = rate
        self._bag_ns = start_ns
        self._wall_s = now_s
        self.paused = False

    def time_ns(self, now_s: float) -> int:
        """Return the bag time at a wall time."""
        if self.paused:
            return self._bag_ns
        return self._bag_ns + max(0, round((now_s - self._wall_s) * self._rate * 1e9))

    def wait_s(self, stamp_ns: int, now_s: float) -> float:
        """Return how long until a message is due: negative if it is late, infinite in a pause."""
        if self.paused:
            return math.inf
        return (stamp_ns - self._bag_ns) * 1e-9 / self._rate - (now_s - self._wall_s)

    def pause(self, paused: bool, now_s: float) -> None:
        """Stop or go on; what is paused already stays so."""
        if paused != self.paused:
            self._bag_ns, self._wall_s = self.time_ns(now_s), now_s
            self.paused = paused

    def set_rate(self, rate: float, now_s: float) -> None:
        """Go on at another rate."""
        self._bag_ns, self._wall_s = self.time_ns(now_s), now_s
        self._rate = rate

    def jump(self, stamp_ns: int, now_s: float) -> None:
        """Set the bag time: a single step in a pause, or the beginning of another round."""
        self._bag_ns, self._wall_s = stamp_ns, now_s


class ScheduleErrors:
    """How late messages were sent, in seconds of wall time."""

    def __init__(self) -> None:
        self._late_s = array("d")

    def add(self, late_s: float) -> None:
        """Count a message that was sent so late."""
        self._late_s.append(late_s)

    def __len__(self) -> int:
        return len(self._late_s)

    def summary_ms(self) -> dict[str, float] | None:
        """Summarise the errors' sizes in milliseconds: median, 99 % and worst; None without messages."""
        if not self._late_s:
            return None
        sizes = np.abs(np.frombuffer(self._late_s)) * 1e3
        median, most = np.percentile(sizes, [50.0, 99.0])
        return {"median_ms": float(median), "p99_ms": float(most), "worst_ms": float(sizes.max())}


class Prefetch:
    """Reads messages ahead on a thread of its own, so that the disk doesn't hold up the schedule; a context manager.

    `next` gives the next message, or None at the end.
    """

    def __init__(self, messages: Iterator[RawMessage]) -> None:
        self._messages = messages
        self._batches: Queue[list[RawMessage] | BagError | None] = Queue(_BATCHES)
        self._batch: deque[RawMessage] = deque()
        self._ended = threading.Event()
        self._over = False
        self._thread = threading.Thread(target=self._read, name="bag reader", daemon=True)

    def __enter__(self) -> Prefetch:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()

    def next(self) -> RawMessage | None:
        """Return the next message, None if there is none.

        Raises:
            BagError: the bag is corrupted.
        """
        while not self._batch and not self._over:
            batch = self._batches.get()
            if isinstance(batch, BagError):
                raise batch
            self._over = batch is None
            self._batch.extend(batch or ())
        return self._batch.popleft() if self._batch else None

    def _read(self) -> None:
        batch: list[RawMessage] = []
        size = 0
        try:
            for message in self._messages:
                batch.append(message)
                size += len(message.cdr)
                if len(batch) >= _BATCH or size > _BATCH_BYTES:
                    self._put(batch)
                    batch, size = [], 0
                if self._ended.is_set():
                    return
            self._put(batch)
            self._put(None)
        except BagError as error:
            self._put(batch)
            self._put(error)

    def _put(self, batch: list[RawMessage] | BagError | None) -> None:
        while not self._ended.is_set():
            try:
                self._batches.put(batch, timeout=_PATIENCE_S)
            except Full:
                continue
            return
