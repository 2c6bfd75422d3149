"""A bounded queue between those who receive messages and the disk: what doesn't fit is dropped and counted."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue

from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import Recorder

QUEUE_BYTES = 1 << 26


class RecordingQueue:
    """Hands messages to a recorder on a thread of its own.

    One thread puts and may never wait for the disk. All methods are for that thread. Once a message could not be
    written, nothing more is taken, and `check` and `finish` say why; putting raises nothing, since callbacks do it.

    Args:
        recorder: where the messages go; it belongs to the queue until `finish`.
        queue_bytes: payload that may wait for the disk; a message that would go beyond it is dropped.
    """

    def __init__(self, recorder: Recorder, queue_bytes: int = QUEUE_BYTES) -> None:
        self._recorder = recorder
        self._limit = queue_bytes
        self._tasks: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        # Two counters, each written by one thread only: no lock is needed.
        self._put_bytes = 0
        self._done_bytes = 0
        self._error: Exception | None = None
        self.dropped: Counter[str] = Counter()
        self.most_waiting_bytes = 0
        self._thread = threading.Thread(target=self._work, name="bag writer", daemon=True)
        self._thread.start()

    @property
    def waiting_bytes(self) -> int:
        """Payload that waits for the disk."""
        return self._put_bytes - self._done_bytes

    def put(self, topic: str, type_name: str, cdr: bytes, received_ns: int | None = None) -> bool:
        """Record a message soon; arguments as for `Recorder.record`. Returns whether there was room for it."""
        if self._error is not None:
            return False
        size = len(cdr)
        waiting = self.waiting_bytes + size
        # A message larger than the queue goes in when nothing else waits, else it never could.
        if waiting > max(self._limit, size):
            self.dropped[topic] += 1
            return False
        self._put_bytes += size
        self.most_waiting_bytes = max(self.most_waiting_bytes, waiting)
        self._tasks.put(partial(self._record, topic, type_name, cdr, received_ns))
        return True

    def call(self, action: Callable[[], object]) -> None:
        """Do something with the recorder after everything that was put before."""
        if self._error is None:
            self._tasks.put(action)

    def check(self) -> None:
        """Raise what went wrong on the disk, if anything.

        Raises:
            BagError: a message could not be written.
        """
        if self._error is not None:
            raise self._error

    def finish(self) -> None:
        """Wait until everything is with the recorder, which then belongs to the caller again.

        Raises:
            BagError: a message could not be written.
        """
        self.stop()
        self.check()

    def stop(self) -> None:
        """Wait until everything is with the recorder; errors are left for `check`."""
        if self._thread.is_alive():
            self._tasks.put(None)
            self._thread.join()

    def _record(self, topic: str, type_name: str, cdr: bytes, received_ns: int | None) -> None:
        self._recorder.record(topic, type_name, cdr, received_ns)
        self._done_bytes += len(cdr)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            try:
                task()
            except BagError as error:
                self._error = error
                return
            except Exception as error:  # a defect: it must end the recording, not only this thread
                self._error = BagError(f"the recorder failed: {type(error).__name__}: {error}")
                self._error.__cause__ = error
                return
