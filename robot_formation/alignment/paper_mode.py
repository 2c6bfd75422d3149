"""`mode: paper`: what one look at the marker means by the paper's visual algorithm, as a rule table.

Paper, "Visual fine-tuning process calibrations": reach the area where only the Target face is seen, then fine-tune the
position along v by the block's column, then u by its side length. The paper's flow chart is missing; our reading of it
is documented in docs/explanation/paper.md ("Reading of the paper").
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from robot_formation.alignment.mode import Decision, Frames, Verdict
from robot_formation.alignment.observation import FaceBox, bounding_boxes
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.geometry.uncertain_motion import TURN_UNKNOWN, UncertainMotion
from robot_formation.parameters import ParameterError, parameter
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block


@dataclass(frozen=True)
class AlignmentParameters:
    """Camera calibration, tolerances and steps of the paper's fine-tuning.

    Cameras are calibrated beside the neighbour at the default formation distance, `geometry.se2.FORMATION_DISTANCE_M`.
    """

    target_x_px: float = parameter(158.5, "Column of the Target block in formation", unit="px", low=0.0, high=315.0)
    slope_px_per_m: float = parameter(
        836.0, "Pan curve: columns per metre along v in a formation of 32 cm", unit="px/m", low=1.0, high=1e5
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
        0.328,
        "Distance from lens to Target face in a formation of 32 cm, at which cameras are calibrated",
        unit="m",
        low=0.01,
        high=10.0,
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

    def at_place(self, place: Motion) -> AlignmentParameters:
        """Return the parameters for another place in the neighbour's frame, by pinhole projection from the calibrated.

        Raises:
            ParameterError: if the lens would be on the neighbour's Target face, or behind it.
        """
        distance_m = self.distance_m + (place.u_m - FORMATION_DISTANCE_M)
        if distance_m <= 0.0:
            raise ParameterError(
                f"fine_tuner: 'formation_distance_m' of {place.u_m} leaves no distance between lens and "
                f"Target face; it must be more than {FORMATION_DISTANCE_M - self.distance_m:.3f}"
            )
        slope_px_per_m = self.slope_px_per_m * (self.distance_m / distance_m)
        target_x_px = self.target_x_px - slope_px_per_m * place.v_m
        return replace(self, distance_m=distance_m, slope_px_per_m=slope_px_per_m, target_x_px=target_x_px)

    def check_place(self, place: Motion) -> None:
        """Check that the paper's rules can keep a place in the neighbour's frame.

        Raises:
            ParameterError: as for `at_place`, or if other faces would show than the Target face: the rules drive away
                from where they do.
        """
        self.at_place(place)
        most_m = 0.5 * self.side_px_m / (self.slope_px_per_m * self.distance_m)  # half of the marker's edge
        if abs(place.v_m) > most_m:
            where = "ahead of" if place.v_m > 0.0 else "behind"
            raise ParameterError(
                f"fine_tuner: 'mode' paper can't keep a place {abs(place.v_m):g} m {where} the neighbour: it needs to "
                f"see the Target face alone, as up to {math.floor(1e3 * most_m) / 1e3:g} m; take mode precise or a "
                "smaller offset"
            )


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
        target = bounding_boxes(blocks).get(Face.TARGET)
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
        alone = set(boxes) == {Face.TARGET}
        decision = self._fine_tune(boxes[Face.TARGET], blocks) if alone else self._enter_target_area(boxes)
        if decision.verdict is Verdict.MOVE:
            if self._moves >= self._p.max_moves:
                return Decision(Verdict.UNALIGNED, reason=f"not aligned after {self._moves} moves: {decision.reason}")
            self._moves += 1
        return decision

    def _enter_target_area(self, boxes: dict[Face, FaceBox]) -> Decision:
        p = self._p
        seen = set(boxes)
        away = -p.coarse_step_m  # the follower drives on its neighbour's right, so away is to its own right
        if len(seen) > 2 or seen == {Face.FRONT, Face.REAR}:
            return Decision(Verdict.MOVE, Motion(y_m=away), "too close: away along u")
        sign, name = (-1.0, "ahead") if Face.FRONT in seen else (1.0, "behind")
        if Face.TARGET in seen:
            return Decision(Verdict.MOVE, Motion(x_m=sign * p.fine_step_m), f"{name}: fine step along v")
        box = boxes[Face.FRONT if Face.FRONT in seen else Face.REAR]
        close = box.side + p.side_bias_px > p.side_px_m / p.distance_m
        return Decision(
            Verdict.MOVE,
            Motion(x_m=sign * p.coarse_step_m, y_m=away if close else 0.0),
            f"well {name}: coarse step along v" + (" and away along u" if close else ""),
        )

    def _fine_tune(self, target: FaceBox, blocks: list[Block]) -> Decision:
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


class PaperMode:
    """`mode: paper` behind the protocol: every timestep is a new alignment, and only a look's last frame counts."""

    def __init__(self, parameters: AlignmentParameters) -> None:
        self._p = parameters
        self._alignment = PaperAlignment(parameters)
        self._blocks: Sequence[Block] = ()
        self._way: UncertainMotion | None = None

    def restart(self, timestep: int, step: UncertainMotion | None = None) -> None:
        """See `AlignmentMode`."""
        left = self.offset() or self._way
        self._alignment = PaperAlignment(self._p)
        self._blocks = ()
        self._way = (left or UncertainMotion(Motion())).then(step) if step is not None else None

    def neighbour_corrects(self) -> None:
        """See `AlignmentMode`: looks are judged each for itself."""

    def turn(self, forecast_rad: float) -> float:
        """See `AlignmentMode`; the rule table leaves the heading alone, so that a forecast turn isn't made either."""
        return 0.0

    def moved(self, asked: Motion, motion: Motion) -> None:
        """See `AlignmentMode`; the rule table has no memory of moves."""
        if self._way is not None:
            self._way = self._way.after(motion)

    def assess(self, frames: Frames) -> Decision:
        """See `AlignmentMode`."""
        self._blocks = frames[-1]
        return self._alignment.assess(self._blocks)

    def caught_up_rad(self) -> float:
        """See `AlignmentMode`: the rule table doesn't know the heading."""
        return 0.0

    def offset(self) -> UncertainMotion | None:
        """See `AlignmentMode`; the rule table doesn't know the heading."""
        offset = self._alignment.offset(self._blocks)
        return None if offset is None else UncertainMotion(offset, TURN_UNKNOWN)

    def ahead(self) -> UncertainMotion | None:
        """See `AlignmentMode`."""
        return self._way
