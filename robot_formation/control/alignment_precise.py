"""`mode: precise`: corrections from an estimate of the neighbour's pose, which lasts over all looks and moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_formation.control.alignment import TARGET, Decision, Verdict
from robot_formation.control.approach import FORMATION, Approach, ApproachParameters, legs, way_to
from robot_formation.control.marker_view import EdgeParameters, mean_boxes
from robot_formation.control.motion import FORMATION_DISTANCE_M, Motion
from robot_formation.control.pose_filter import FilterParameters, PoseFilter
from robot_formation.control.relative_pose import GeometryParameters, MarkerModel, Vector, X, Y
from robot_formation.parameters import parameter
from robot_formation.vision.block import Block

_VANTAGES_M = (0.14, 0.11, -0.11, -0.14, -0.125, 0.125, 0.15, -0.15)
_VANTAGE_BESIDE_M = 0.33
_LAST_MOVES = 5
_CLUELESS_RAD = 0.08
_ASIDE_RAD = 0.25
_LEAST_DRIVE_M = 0.02
_SLIP_GAIN = 0.3
_LEAST_LEG_M = 0.0022
_LONGEST_BESIDE_M = 0.01
_SHORT_DRIVE_M = 0.06
_MOST_SHORT_M = 0.006
_SHORT_GAIN = 0.5


@dataclass(frozen=True)
class PreciseParameters:
    """Tolerances and bounds of `mode: precise`, and what its estimate knows of camera, marker, detector and moves."""

    u_tolerance_m: float = parameter(0.007, "Offset along u that is left alone", unit="m", low=0.0005, high=0.1)
    v_tolerance_m: float = parameter(0.006, "Offset along v that is left alone", unit="m", low=0.0005, high=0.1)
    heading_tolerance_rad: float = parameter(
        math.radians(3.0), "Heading error that is left to the next prediction move", unit="rad", low=0.001, high=1.0
    )
    turn_rad: float = parameter(
        math.radians(0.8), "Heading error from which on the prediction move turns too", unit="rad", low=0.001, high=1.0
    )
    certain_rad: float = parameter(
        math.radians(0.5), "Standard deviation of the heading that ends the first alignment", unit="rad", low=1e-3, high=1.0
    )
    placed_heading_rad: float = parameter(
        math.radians(1.0),
        "Standard deviation of the heading of a follower that was placed in formation by hand",
        unit="rad",
        low=1e-4,
        high=1.0,
    )
    placed_m: float = parameter(
        0.02, "Offset up to which a follower counts as placed in formation", unit="m", low=0.0, high=0.2
    )
    averaged_frames: int = parameter(10, "Last frames of a look that are averaged", low=1, high=600)
    max_moves: int = parameter(14, "Corrections per timestep after which the follower goes on unaligned", low=1, high=1000)
    geometry: GeometryParameters = GeometryParameters()
    edges: EdgeParameters = EdgeParameters()
    filter: FilterParameters = FilterParameters()
    approach: ApproachParameters = ApproachParameters()


class PreciseAlignment:
    """Keeps the estimate over the timesteps; one decision a look."""

    looks_before = True

    def __init__(self, parameters: PreciseParameters, first_step_m: float) -> None:
        self._p = parameters
        self._filter = PoseFilter(MarkerModel(parameters.geometry), parameters.edges, parameters.filter)
        self._approach = Approach(parameters.approach)
        self._neighbour_step = Motion(x_m=first_step_m)
        self._moves = 0
        self._timestep = 0
        self._vantages: list[float] = []
        self._slip = 0.0
        self._wanted: Motion | None = None
        self._short: dict[tuple[str, bool], float] = {}

    def restart(self, timestep: int) -> None:
        """Begin a timestep: the neighbour has made its step."""
        self._moves = 0
        self._timestep = timestep
        if timestep > 0:
            step = self._neighbour_step
            self._filter.neighbour_stepped(Motion(step.x_m, self._slip * step.x_m))

    def turn_before(self, frames: Sequence[Sequence[Block]]) -> float:
        """Look before the prediction move; returns the turn [rad] that goes with it."""
        boxes = self._boxes(frames)
        if TARGET in boxes and self._filter.known:
            self._filter.look(boxes)
        if not self._filter.known:
            return 0.0
        heading = way_to(self._filter.best.state, FORMATION).yaw_rad
        return heading if abs(heading) > self._p.turn_rad else 0.0

    def moved(self, asked: Motion, motion: Motion) -> None:
        """Take a measured move, and learn from it how far a drive ahead slips aside."""
        self._filter.moved(motion)
        self._wanted = self._learn(asked, motion)
        if asked.x_m > _LEAST_DRIVE_M and motion.x_m > _LEAST_DRIVE_M:
            # A leg shorter than the robot's coasting is not driven at all.
            driven = asked.y_m if abs(asked.y_m) > _LEAST_LEG_M else 0.0
            if abs(driven) < _LONGEST_BESIDE_M:
                self._slip += _SLIP_GAIN * ((motion.y_m - driven) / motion.x_m - self._slip)

    def _learn(self, asked: Motion, motion: Motion) -> Motion | None:
        """Learn from a correction what the drive falls short by on each axis and in each direction."""
        wanted = self._wanted
        if wanted is None:
            return None
        c, s = math.cos(asked.yaw_rad), math.sin(asked.yaw_rad)
        for axis, want, got, sent in (
            ("v", c * wanted.x_m + s * wanted.y_m, c * motion.x_m + s * motion.y_m, c * asked.x_m + s * asked.y_m),
            ("u", c * wanted.y_m - s * wanted.x_m, c * motion.y_m - s * motion.x_m, c * asked.y_m - s * asked.x_m),
        ):
            if want and abs(want) < _SHORT_DRIVE_M:
                key = (axis, want > 0.0)
                missing = (sent - got) * math.copysign(1.0, want)
                known = self._short.get(key, 0.0)
                self._short[key] = max(0.0, min(_MOST_SHORT_M, known + _SHORT_GAIN * (missing - known)))
        return None

    def _compensated(self, motion: Motion) -> Motion:
        """Ask for as much more as the drive has lately fallen short by."""
        c, s = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
        x, y = c * motion.x_m + s * motion.y_m, c * motion.y_m - s * motion.x_m
        x += math.copysign(self._short.get(("v", x > 0.0), 0.0), x) if 0.0 < abs(x) < _SHORT_DRIVE_M else 0.0
        y += math.copysign(self._short.get(("u", y > 0.0), 0.0), y) if 0.0 < abs(y) < _SHORT_DRIVE_M else 0.0
        return Motion(c * x - s * y, s * x + c * y, motion.yaw_rad)

    def offset(self) -> Motion | None:
        """Estimate the way to the formation position in the follower's frame."""
        return way_to(self._filter.best.state, FORMATION) if self._filter.known else None

    def assess(self, frames: Sequence[Sequence[Block]]) -> Decision:
        """Decide what the last look calls for."""
        boxes = self._boxes(frames)
        if not boxes:
            return Decision(Verdict.LOOK, reason="no block in view")
        first = not self._filter.known
        self._filter.look(boxes)
        state = self._filter.best.state
        way = way_to(state, FORMATION)
        if first and set(boxes) == {TARGET} and self._placed(state):
            self._filter.assume_heading(self._p.placed_heading_rad)
            way = way_to(self._filter.best.state, FORMATION)
        unsure = self._filter.yaw_sigma_rad > self._p.certain_rad
        searching = unsure and self._timestep == 0 and self._moves < self._p.max_moves - _LAST_MOVES
        if not searching and self._within(way):
            return Decision(Verdict.ALIGNED, reason="inside the tolerances")
        if self._moves >= self._p.max_moves:
            return Decision(Verdict.UNALIGNED, reason=f"not aligned after {self._moves} moves")
        motion, reason = self._next(state, searching)
        if motion == Motion():
            return Decision(Verdict.UNALIGNED, reason="no way to the formation position keeps clear of the neighbour")
        self._moves += 1
        self._wanted = motion
        return Decision(Verdict.MOVE, self._compensated(motion), reason)

    def _next(self, state: Vector, searching: bool) -> tuple[Motion, str]:
        """Choose the next motion and say why."""
        states = self._filter.likely()
        if self._filter.yaw_sigma_rad > _CLUELESS_RAD and abs(math.atan2(state[X], state[Y])) > _ASIDE_RAD:
            return self._approach.face(states), "turn towards the marker"
        if searching:
            return self._without_trifles(self._approach.next(states, self._vantage(state))), "to see two faces"
        return self._without_trifles(self._approach.next(states, FORMATION)), "to the formation position"

    def _boxes(self, frames: Sequence[Sequence[Block]]) -> dict[int, object]:
        return mean_boxes(frames[-self._p.averaged_frames :])

    def _placed(self, state: Vector) -> bool:
        return math.hypot(state[X], state[Y] - FORMATION_DISTANCE_M) < self._p.placed_m

    def _within(self, way: Motion) -> bool:
        p = self._p
        return (
            abs(way.y_m) <= p.u_tolerance_m
            and abs(way.x_m) <= p.v_tolerance_m
            and abs(way.yaw_rad) <= p.heading_tolerance_rad
        )

    def _without_trifles(self, motion: Motion) -> Motion:
        """Leave out legs that are hardly worth a move."""
        p = self._p
        c, s = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
        x, y = c * motion.x_m + s * motion.y_m, c * motion.y_m - s * motion.x_m
        yaw = motion.yaw_rad if abs(motion.yaw_rad) > 0.4 * p.heading_tolerance_rad else 0.0
        x = x if abs(x) > 0.5 * p.v_tolerance_m else 0.0
        y = y if abs(y) > 0.5 * p.u_tolerance_m else 0.0
        c, s = math.cos(yaw), math.sin(yaw)
        return Motion(c * x - s * y, s * x + c * y, yaw)

    def _vantage(self, state: Vector) -> Motion:
        """A place behind or ahead from where a second face shows: twice on the near side, then on the other.

        The outer edges of Front and Rear are biased alike, so that the two sides' errors in heading cancel.
        """
        if not self._vantages:
            behind = way_to(state, Motion()).x_m > 0.0
            self._vantages = [-place if behind else place for place in _VANTAGES_M]
        place = self._vantages.pop(0)
        return Motion(place, -_VANTAGE_BESIDE_M, 0.0)
