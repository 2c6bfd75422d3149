"""What one look at the marker means: the paper's visual algorithm, as a rule table without input or output.

Paper, "Visual fine-tuning process calibrations": reach the area where only the Target face is seen, then fine-tune the
position along v by the block's column, then u by its side length. The paper's flow chart is missing; our reading of it
is documented in docs/explanation/paper.md ("Reading of the paper").
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import parameter
from robot_formation.vision.pixy2.block import Block

TARGET, FRONT, REAR = 1, 2, 3


@dataclass(frozen=True)
class AlignmentParameters:
    """Camera calibration, tolerances and steps of the paper's fine-tuning."""

    target_x_px: float = parameter(158.5, "Column of the Target block in formation", unit="px", low=0.0, high=315.0)
    slope_px_per_m: float = parameter(
        836.0, "Pan curve: columns per metre along v at the formation distance", unit="px/m", low=1.0, high=1e5
    )
    side_px_m: float = parameter(
        16.64,
        "Side-length curve: side length times distance (focal length times marker size)",
        unit="px m",
        low=0.1,
        high=1e4,
    )
    side_bias_px: float = parameter(
        2.65, "What the detector reports less than the true side length", unit="px", low=-20.0, high=20.0
    )
    distance_m: float = parameter(
        0.328, "Distance from lens to Target face in formation", unit="m", low=0.01, high=10.0
    )
    v_tolerance_px: float = parameter(5.0, "Tolerance of the column (paper: 5 px)", unit="px", low=0.0, high=100.0)
    u_tolerance_m: float = parameter(0.015, "Tolerance along u (paper: 1.5 cm)", unit="m", low=0.0, high=1.0)
    side_tolerance_px: float = parameter(
        4.0,
        "Tolerated difference of the side lengths, which tells the heading (paper: 4 px)",
        unit="px",
        low=0.0,
        high=100.0,
    )
    coarse_step_m: float = parameter(0.05, "Step outside the Target area", unit="m", low=0.001, high=0.1)
    fine_step_m: float = parameter(0.02, "Step at the Target area's edge", unit="m", low=0.001, high=0.1)
    turn_step_rad: float = parameter(math.radians(5.0), "Step in heading", unit="rad", low=0.001, high=1.0)
    max_v_step_m: float = parameter(0.1, "Longest single correction along v", unit="m", low=0.001, high=0.2)
    max_u_step_m: float = parameter(0.1, "Longest single correction along u", unit="m", low=0.001, high=0.1)
    max_moves: int = parameter(
        14, "Corrections per timestep after which the follower goes on unaligned", low=1, high=1000
    )
    max_empty_looks: int = parameter(3, "Looks without a block after which the leader is lost", low=1, high=1000)


class Verdict(Enum):
    """What to do after a look."""

    MOVE = "move"
    LOOK = "look"
    SEARCH = "search"
    ALIGNED = "aligned"
    UNALIGNED = "unaligned"
    LOST = "lost"


@dataclass(frozen=True)
class Decision:
    """The verdict of a look, the motion that goes with MOVE and SEARCH, and the reason in words."""

    verdict: Verdict
    motion: Motion = Motion()
    reason: str = ""


@dataclass(frozen=True)
class Box:
    """Bounding box of the blocks of one signature: inclusive edges in pixels."""

    left: float
    right: float
    top: float
    bottom: float

    @property
    def x(self) -> float:
        """Column of the centre, px."""
        return (self.left + self.right) / 2.0

    @property
    def width(self) -> float:
        """Width as the camera reports it, px."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Height as the camera reports it, px."""
        return self.bottom - self.top

    @property
    def side(self) -> float:
        """The longer side, px: a face seen obliquely is narrower, not lower."""
        return max(self.width, self.height)


def bounding_boxes(blocks: Iterable[Block]) -> dict[int, Box]:
    """Merge the blocks of each marker signature into their bounding box (a face split by flicker counts once)."""
    boxes: dict[int, Box] = {}
    for block in blocks:
        if block.signature not in (TARGET, FRONT, REAR):
            continue
        half_width, half_height = block.width / 2.0, block.height / 2.0
        box = Box(block.x - half_width, block.x + half_width, block.y - half_height, block.y + half_height)
        known = boxes.get(block.signature)
        if known is not None:
            box = Box(
                min(known.left, box.left),
                max(known.right, box.right),
                min(known.top, box.top),
                max(known.bottom, box.bottom),
            )
        boxes[block.signature] = box
    return boxes


class PaperAlignment:
    """`mode: paper`: one alignment (the looks and corrections of one timestep).

    Feed it the blocks of each look; it answers with one decision a look.
    """

    def __init__(self, parameters: AlignmentParameters) -> None:
        self._p = parameters
        self._moves = 0
        self._empty_looks = 0
        self._turn_sign = 1.0
        self._difference_before_turn: float | None = None

    def offset(self, blocks: Iterable[Block]) -> Motion | None:
        """Estimate the way to the formation position in the follower's frame, or None without a Target block."""
        target = bounding_boxes(blocks).get(TARGET)
        if target is None:
            return None
        side = max(target.side + self._p.side_bias_px, 1.0)
        return Motion(
            x_m=(target.x - self._p.target_x_px) / self._p.slope_px_per_m,
            y_m=self._p.side_px_m / side - self._p.distance_m,
        )

    def assess(self, blocks: Iterable[Block]) -> Decision:
        """Decide what the last look calls for."""
        blocks = list(blocks)
        boxes = bounding_boxes(blocks)
        if not boxes:
            self._empty_looks += 1
            lost = self._empty_looks >= self._p.max_empty_looks
            return Decision(Verdict.LOST if lost else Verdict.LOOK, reason="no block in view")
        self._empty_looks = 0
        decision = self._fine_tune(boxes[TARGET], blocks) if set(boxes) == {TARGET} else self._enter_target_area(boxes)
        if decision.verdict is Verdict.MOVE:
            if self._moves >= self._p.max_moves:
                return Decision(Verdict.UNALIGNED, reason=f"not aligned after {self._moves} moves: {decision.reason}")
            self._moves += 1
        return decision

    def _enter_target_area(self, boxes: dict[int, Box]) -> Decision:
        p = self._p
        seen = set(boxes)
        away = -p.coarse_step_m  # the follower drives on its neighbour's right, so away is to its own right
        if len(seen) > 2 or seen == {FRONT, REAR}:
            return Decision(Verdict.MOVE, Motion(y_m=away), "too close: away along u")
        sign, name = (-1.0, "ahead") if FRONT in seen else (1.0, "behind")
        if TARGET in seen:
            return Decision(Verdict.MOVE, Motion(x_m=sign * p.fine_step_m), f"{name}: fine step along v")
        box = boxes[FRONT if FRONT in seen else REAR]
        close = box.side + p.side_bias_px > p.side_px_m / p.distance_m
        return Decision(
            Verdict.MOVE,
            Motion(x_m=sign * p.coarse_step_m, y_m=away if close else 0.0),
            f"well {name}: coarse step along v" + (" and away along u" if close else ""),
        )

    def _fine_tune(self, target: Box, blocks: list[Block]) -> Decision:
        p = self._p
        offset = self.offset(blocks)
        assert offset is not None  # the Target block is in view here
        difference = abs(target.width - target.height)
        if abs(target.x - p.target_x_px) > p.v_tolerance_px:
            step = max(-p.max_v_step_m, min(p.max_v_step_m, offset.x_m))
            return Decision(Verdict.MOVE, Motion(x_m=step), "fine-tune v")
        if abs(offset.y_m) > p.u_tolerance_m:
            step = max(-p.max_u_step_m, min(p.max_u_step_m, offset.y_m))
            return Decision(Verdict.MOVE, Motion(y_m=step), "fine-tune u")
        if difference > p.side_tolerance_px:
            before = self._difference_before_turn
            if before is not None and difference > before:
                self._turn_sign = -self._turn_sign
            self._difference_before_turn = difference
            return Decision(Verdict.MOVE, Motion(yaw_rad=self._turn_sign * p.turn_step_rad), "turn")
        return Decision(Verdict.ALIGNED, reason="inside the tolerances")
