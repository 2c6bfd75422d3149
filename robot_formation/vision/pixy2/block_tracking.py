"""Tracking: blocks keep their index from frame to frame, appear late and vanish late (Pixy2 behaviour).

The loops go over pairs of tracks and boxes. Where there is a C compiler they are compiled, with the types of
block_tracking.pxd.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.errors import FormationError
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.boxes import Box

ALL_SIGNATURES = 0xFF
"""The signature mask of a request for blocks of all signatures."""
ALL_BLOCKS = 255
"""The largest number of blocks that a request asks for."""
FRAME_US = 16200
"""Nominal time between frames, microseconds: the unit of the velocity gate and the first frame's interval."""
_TICK_BITS = 10
_TICK_MASK = 0xFFFF
_TICKS_PER_STEP = 16
_OLDEST = 255
_INDICES = 256
_ANSWERED = 18
"""Blocks that fit into the packet of the camera's answer."""
_CODES = 0x80
"""The bit of colour codes in a request's signature mask."""
_UNLIMITED = 1 << 62
"""More than the square of any jump, and still a number of 64 bits."""
_NOBODY = -1
# States of a track.
_LEADING = 0
_VALID = 1
_TRAILING = 2


class ClockError(FormationError):
    """A frame is not later than the one before it."""


@dataclass
class BoxTrack:
    """A box over time.

    Attributes:
        box: the last one seen.
        index: the running number.
        stamp: the tick of its creation or, when trailing, of its loss.
        state: leading (not reported yet), valid or trailing (lost, and still reported).
        age: frames since it was first reported.
    """

    box: Box
    index: int
    stamp: int
    state: int = 0
    age: int = 0


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
        self._tracks: list[BoxTrack] = []
        self._next_index = 0
        self._origin_us: int | None = None
        self._last_us = 0

    def step(self, boxes: list[Box], time_us: int) -> None:
        """Process one frame's boxes.

        Args:
            boxes: the boxes, in the detector's order.
            time_us: the frame's time, microseconds; the first frame's time is the clock's origin.

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
        # A jump (half of its square, in square pixels) is allowed if jump * FRAME_US // interval <= gate.
        limit = min(((self._gate + 1) * interval - 1) // FRAME_US, _UNLIMITED)
        owners = self._assign(boxes, limit)
        owned: list[Box | None] = [None] * len(self._tracks)
        for number in range(len(boxes)):
            owner = owners[number]
            if owner != _NOBODY:
                owned[owner] = boxes[number]
        tracks = [track for track, box in zip(self._tracks, owned, strict=True) if self._update(track, box, now)]
        for number in range(len(boxes)):
            if owners[number] == _NOBODY:
                tracks.append(BoxTrack(boxes[number], self._next_index, now))
                self._next_index = (self._next_index + 1) % _INDICES
        self._tracks = tracks

    def answer(self, sigmap: int, max_blocks: int) -> list[Block]:
        """What the camera's getBlocks request answers after the last frame: at most 18 blocks fit into its packet.

        Args:
            sigmap: bit sig-1 for each signature wanted, 0x80 for colour codes.
            max_blocks: how many blocks are wanted.

        Returns:
            The blocks of the first tracks that are wanted, largest width * height first.
        """
        blocks: list[Block] = []
        for track in self._tracks:
            if track.state == _LEADING:
                continue
            box = track.box
            signature = box.signature
            if not sigmap & (1 << (signature - 1) if signature < 8 else _CODES):
                continue
            blocks.append(Block(signature, box.x, box.y, box.width, box.height, box.angle, track.index, track.age))
            if len(blocks) == _ANSWERED:
                break
        blocks.sort(key=_negative_size)
        return blocks[: max(max_blocks, 0)]

    def _assign(self, boxes: list[Box], limit: int) -> list[int]:
        """The track number that owns each box, or _NOBODY."""
        owners = [_NOBODY] * len(boxes)
        costs = self._costs(boxes, limit)
        searching = [True] * len(self._tracks)
        assigned = True
        while assigned:
            assigned = False
            for number in range(len(searching)):
                if not searching[number]:
                    continue
                choice = self._choose(number, owners, costs)
                if choice == _NOBODY:
                    continue
                evicted = owners[choice]
                if evicted != _NOBODY:
                    searching[evicted] = True
                owners[choice] = number
                searching[number] = False
                assigned = True
        return owners

    def _choose(self, number: int, owners: list[int], costs: list[dict[int, int]]) -> int:
        """The cheapest box that is free or that this track may take from its owner; _NOBODY if there is none."""
        best = _NOBODY
        lowest = 0
        track = self._tracks[number]
        for box, cost in costs[number].items():
            if best != _NOBODY and cost >= lowest:
                continue
            owner = owners[box]
            if owner != _NOBODY:
                rival = self._tracks[owner]
                stronger = track.state != _LEADING or rival.state == _LEADING
                if not stronger or costs[owner][box] <= cost:
                    continue
            best = box
            lowest = cost
        return best

    def _costs(self, boxes: list[Box], limit: int) -> list[dict[int, int]]:
        """For each track the boxes of its signature that are no larger jump than allowed, with their cost.

        The cost is the mean square distance of the sides, square pixels.
        """
        of_signature: dict[int, list[int]] = {}
        for number in range(len(boxes)):
            of_signature.setdefault(boxes[number].signature, []).append(number)
        costs: list[dict[int, int]] = []
        for track in self._tracks:
            old = track.box
            near: dict[int, int] = {}
            for number in of_signature.get(old.signature, []):
                new = boxes[number]
                x = ((new.left + new.right) >> 1) - ((old.left + old.right) >> 1)
                y = ((new.top + new.bottom) >> 1) - ((old.top + old.bottom) >> 1)
                if (x * x + y * y) >> 1 <= limit:
                    left, right = new.left - old.left, new.right - old.right
                    top, bottom = new.top - old.top, new.bottom - old.bottom
                    near[number] = (left * left + right * right + top * top + bottom * bottom) >> 2
            costs.append(near)
        return costs

    def _update(self, track: BoxTrack, box: Box | None, now: int) -> bool:
        """Advance a track by one frame; False if it is to be removed."""
        if box is not None:
            track.box = box
        elapsed = (now - track.stamp) & _TICK_MASK
        if track.state == _LEADING:
            if box is not None and elapsed >= self._lead:
                track.state = _VALID
            return box is not None
        track.age = min(track.age + 1, _OLDEST)
        if box is not None:
            track.state = _VALID
        elif track.state == _VALID:
            track.state = _TRAILING
            track.stamp = now
            return self._trail > 0
        else:
            return elapsed < self._trail
        return True


def _negative_size(block: Block) -> int:
    return -block.width * block.height
