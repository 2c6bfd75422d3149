"""Tracking: blocks keep their index from frame to frame, appear late and vanish late (Pixy2 behaviour)."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_formation.errors import FormationError
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.boxes import Box

FRAME_US = 16200
"""Nominal time between frames, microseconds: the unit of the velocity gate and the first frame's interval."""
_TICK_BITS = 10
_TICK_MASK = 0xFFFF
_TICKS_PER_STEP = 16
_OLDEST = 255
_INDICES = 256


class ClockError(FormationError):
    """A frame is not later than the one before it."""


class _State(enum.Enum):
    LEADING = enum.auto()
    VALID = enum.auto()
    TRAILING = enum.auto()


@dataclass(slots=True)
class _Track:
    """A box over time; `stamp` is the tick of its creation or, when trailing, of its loss."""

    box: Box
    index: int
    stamp: int
    state: _State = _State.LEADING
    age: int = 0

    def block(self) -> Block:
        box = self.box
        return Block(box.signature, box.x, box.y, box.width, box.height, box.angle, self.index, self.age)


class Tracker:
    """Assigns each frame's boxes to the tracks of earlier frames.

    Args:
        block_filtering: steps of 16 ticks (of 1.024 ms) that a box must be seen before it is reported.
        max_velocity: largest jump, about pixels per 16.2 ms.
    """

    def __init__(self, block_filtering: int, max_velocity: int) -> None:
        self.configure(block_filtering, max_velocity)
        self.reset()

    def configure(self, block_filtering: int, max_velocity: int) -> None:
        """Change the filtering and the velocity gate; tracks are kept."""
        self._lead = _TICKS_PER_STEP * block_filtering
        self._trail = (self._lead + 1) >> 1
        self._gate = max_velocity * max_velocity

    def reset(self) -> None:
        """Forget all tracks; the next frame starts the clock and the indices anew."""
        self._tracks: list[_Track] = []
        self._next_index = 0
        self._origin_us: int | None = None
        self._last_us = 0

    def step(self, boxes: Sequence[Box], time_us: int) -> list[Block]:
        """Process one frame's boxes.

        Args:
            boxes: the boxes, in the detector's order.
            time_us: the frame's time, microseconds; the first frame's time is the clock's origin.

        Returns:
            The reported blocks in the order of their tracks.

        Raises:
            ClockError: if the time is not later than the previous frame's.
        """
        if self._origin_us is None:
            self._origin_us = time_us
            interval = FRAME_US
        else:
            interval = time_us - self._last_us
            if interval <= 0:
                raise ClockError(
                    f"the frame at {time_us} us is not later than the last one ({self._last_us} us); reset the detector"
                )
        self._last_us = time_us
        now = ((time_us - self._origin_us) >> _TICK_BITS) & _TICK_MASK
        owners = self._assign(boxes, interval)
        owned = {track: box for box, track in enumerate(owners) if track is not None}
        self._tracks = [
            track
            for number, track in enumerate(self._tracks)
            if self._update(track, boxes[owned[number]] if number in owned else None, now)
        ]
        for box, owner in zip(boxes, owners, strict=True):
            if owner is None:
                self._tracks.append(_Track(box, self._next_index, now))
                self._next_index = (self._next_index + 1) % _INDICES
        return [track.block() for track in self._tracks if track.state is not _State.LEADING]

    def _assign(self, boxes: Sequence[Box], interval: int) -> list[int | None]:
        """The track number that owns each box, or None."""
        owners: list[int | None] = [None] * len(boxes)
        costs = self._costs(boxes, interval)
        searching = set(range(len(self._tracks)))
        assigned = True
        while assigned:
            assigned = False
            for number in range(len(self._tracks)):
                if number not in searching:
                    continue
                choice = self._choose(number, owners, costs)
                if choice is None:
                    continue
                evicted = owners[choice]
                if evicted is not None:
                    searching.add(evicted)
                owners[choice] = number
                searching.discard(number)
                assigned = True
        return owners

    def _choose(self, number: int, owners: list[int | None], costs: list[dict[int, int]]) -> int | None:
        """The cheapest box that is free or that this track may take from its owner."""
        best: int | None = None
        lowest = math.inf
        for box, cost in costs[number].items():
            if cost >= lowest:
                continue
            owner = owners[box]
            if owner is not None:
                stronger = self._tracks[number].state is not _State.LEADING or (
                    self._tracks[owner].state is _State.LEADING
                )
                if costs[owner][box] <= cost or not stronger:
                    continue
            best, lowest = box, cost
        return best

    def _costs(self, boxes: Sequence[Box], interval: int) -> list[dict[int, int]]:
        """For each track the boxes of its signature that are no larger jump than allowed, with their cost."""
        candidates: dict[int, list[tuple[int, int, int, Box]]] = {}
        for number, box in enumerate(boxes):
            candidates.setdefault(box.signature, []).append((number, box.x, box.y, box))
        costs: list[dict[int, int]] = []
        for track in self._tracks:
            old = track.box
            x, y = old.x, old.y
            near: dict[int, int] = {}
            for number, new_x, new_y, new in candidates.get(old.signature, ()):
                jump = ((new_x - x) ** 2 + (new_y - y) ** 2) >> 1
                if jump * FRAME_US // interval <= self._gate:
                    near[number] = _difference(old, new)
            costs.append(near)
        return costs

    def _update(self, track: _Track, box: Box | None, now: int) -> bool:
        """Advance a track by one frame; False if it is to be removed."""
        if box is not None:
            track.box = box
        elapsed = (now - track.stamp) & _TICK_MASK
        if track.state is _State.LEADING:
            if box is not None and elapsed >= self._lead:
                track.state = _State.VALID
            return box is not None
        track.age = min(track.age + 1, _OLDEST)
        if box is not None:
            track.state = _State.VALID
        elif track.state is _State.VALID:
            track.state = _State.TRAILING
            track.stamp = now
            return self._trail > 0
        else:
            return elapsed < self._trail
        return True


def _difference(old: Box, new: Box) -> int:
    """Mean square distance of the sides, square pixels."""
    sides = (new.left - old.left) ** 2 + (new.right - old.right) ** 2
    return (sides + (new.top - old.top) ** 2 + (new.bottom - old.bottom) ** 2) >> 2


def limited(blocks: Sequence[Block], sigmap: int, max_blocks: int) -> list[Block]:
    """What the camera's getBlocks request answers: at most 18 blocks fit into its packet.

    Args:
        blocks: the reported blocks in the order of their tracks.
        sigmap: bit sig-1 for each signature wanted, 0x80 for colour codes.
        max_blocks: how many blocks are wanted.

    Returns:
        The blocks, largest width * height first.
    """
    wanted = [block for block in blocks if sigmap & (1 << (block.signature - 1) if block.signature < 8 else 0x80)]
    answer = sorted(wanted[:18], key=lambda block: -block.width * block.height)
    return answer[: max(max_blocks, 0)]
