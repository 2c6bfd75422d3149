"""Counts messages that the middleware has lost, by the gaps in their publishers' sequence numbers."""

from __future__ import annotations

_MOST_STREAMS = 64  # publishers that come and go leave streams behind


class LossCounter:
    """Counts the losses of one topic.

    Every publisher numbers its messages, from 1 on and without a gap. The numbers don't say whose they are: a message
    continues the stream whose last number is the nearest one below its own. With one publisher the count is exact;
    with several it is as long as each has been heard once.
    """

    def __init__(self) -> None:
        self._last: list[int] = []  # of each stream, the one continued last at the end

    def take(self, number: int, publishers: int) -> int:
        """Process a message's number; return how many messages are missing before it.

        Args:
            number: the sequence number that its publisher gave it.
            publishers: how many publishers the topic has: as long as fewer have been heard, a number that continues
                no stream is a new publisher's first.
        """
        place = max((i for i, last in enumerate(self._last) if last < number), key=self._last.__getitem__, default=-1)
        missing = number - self._last[place] - 1 if place >= 0 else 0
        if place < 0 or (missing and len(self._last) < publishers):
            self._last = [*self._last[1 - _MOST_STREAMS :], number]
            return 0
        del self._last[place]
        self._last.append(number)
        return missing
