"""`mode: precise`: corrections from an estimate of the neighbour's pose, which lasts over all looks and moves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from robot_formation.alignment.mode import Decision, Frames, Verdict
from robot_formation.alignment.observation import FaceBox
from robot_formation.alignment.precise.actuation_model import ActuationModel, ActuationParameters
from robot_formation.alignment.precise.heading_check import Deviation, HeadingCheck, HeadingCheckParameters
from robot_formation.alignment.precise.marker_edges import EdgeParameters, mean_boxes
from robot_formation.alignment.precise.marker_projection import (
    YAW,
    GeometryParameters,
    MarkerModel,
    Vector,
    X,
    Y,
    after_motion,
    pose_of,
)
from robot_formation.alignment.precise.motion_planner import MotionPlanner, PlannerParameters, count_legs
from robot_formation.alignment.precise.neighbour_search import NeighbourSearch, SearchParameters
from robot_formation.alignment.precise.pose_filter import FilterParameters, PoseFilter
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion, composition_jacobians
from robot_formation.parameters import parameter
from robot_formation.vision.marker import Face

# All chosen.
_IMPLAUSIBLE_NIS = 6.0
"""NIS of a look from which on it is taken not to show the whole marker."""
_VIEWPOINTS_M = (0.135, -0.135, 0.135, -0.12, 0.12)
"""Places along v [m] from where a second face is wide enough to be measured well, in the order of visits; the side on
which the neighbour stands is the positive one."""
_CHECK_PLACES_M = (-0.135, 0.135)
"""The same of a check of the heading, which ends where a second face shows: first where the follower came from."""
_SECOND_FACE_PX = 8.0
"""Width from which on a second face tells the heading."""
_LEAST_FORECAST_SIGMA_M = 0.0035
"""A forecast's error aside is never taken for smaller: the looks' own is 2 to 3 mm."""
_VIEWPOINT_NEARER_M = 0.008
"""How much nearer to the neighbour than in formation these places lie."""
_VIEWPOINT_TOLERANCE = Motion(0.02, 0.02, math.radians(6.0))
"""How far from such a place is near enough."""
_CORRECTION_SIGMA_M = 0.02
"""Standard deviation of a neighbour's correction that may have happened between two looks, along each axis."""
_SPARE_MOVES = 2
"""Moves left over for last corrections."""
_ENOUGH_MOVES = 6
"""As long as so many are left, the way back isn't counted."""
_DEADBAND, _FIRST_DEADBAND = 0.8, 0.5
"""Share of the tolerance up to which an offset is left alone while the other axis is corrected; in timestep 0."""
_TURN_DEADBAND = 0.7
"""The same of the heading's tolerance, in every timestep."""
_UNKNOWN_HEADING_RAD = 0.08
"""Standard deviation of the heading from which on it counts as hardly known."""
_ASIDE_RAD = 0.25
"""Bearing of the neighbour, from straight aside, from which on a follower that hardly knows its heading turns first."""


@dataclass(frozen=True)
class PreciseParameters:
    """Tolerances and bounds of `mode: precise`, and what its estimate knows of camera, marker, detector and moves."""

    u_tolerance_m: float = parameter(
        0.009,
        "Offset along u that is left alone. A scenario with two followers and more, in turns or wave, sets 0.005",
        unit="m",
        low=0.0005,
        high=0.1,
    )
    v_tolerance_m: float = parameter(
        0.006,
        "Offset along v that is left alone. A scenario with two followers and more, in turns or wave, sets 0.004",
        unit="m",
        low=0.0005,
        high=0.1,
    )
    heading_tolerance_rad: float = parameter(
        math.radians(3.0), "Heading error that is left to the next prediction move", unit="rad", low=0.001, high=1.0
    )
    turn_rad: float = parameter(
        math.radians(0.8), "Heading error from which on the prediction move turns too", unit="rad", low=0.001, high=1.0
    )
    first_share: float = parameter(
        0.58, "Share of these offsets that the first alignment leaves alone", low=0.01, high=1.0
    )
    certain_rad: float = parameter(
        math.radians(0.8),
        "Standard deviation of the heading that ends the first alignment",
        unit="rad",
        low=1e-3,
        high=1.0,
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
    max_moves: int = parameter(
        14, "Corrections per timestep after which the follower goes on unaligned", low=1, high=1000
    )
    geometry: GeometryParameters = GeometryParameters()
    edges: EdgeParameters = EdgeParameters()
    filter: FilterParameters = FilterParameters()
    actuation: ActuationParameters = ActuationParameters()
    approach: PlannerParameters = PlannerParameters()
    search: SearchParameters = SearchParameters()
    heading_check: HeadingCheckParameters = HeadingCheckParameters()


class PreciseAlignment:
    """Keeps the estimate over the timesteps; one decision a look."""

    def __init__(self, parameters: PreciseParameters, place: Motion) -> None:
        """Begin without an estimate; the `place` to keep is given in the neighbour's frame."""
        self._p = parameters
        drive = parameters.actuation
        self._filter = PoseFilter(
            MarkerModel(parameters.geometry),
            parameters.edges,
            parameters.filter,
            drive.least_leg_m,
            drive.wheel_lever_m,
        )
        self._planner = MotionPlanner(parameters.approach)
        self._actuation = ActuationModel(parameters.actuation, parameters.filter.move_floor_m)
        self._search = NeighbourSearch(parameters.search)
        self._check = HeadingCheck(parameters.heading_check)
        self._stepped = False  # the neighbour, and no look since then
        self._expected_rad: float | None = None  # the heading, while it is checked
        self._doubted = False  # whether the check has begun to move
        self._formation = place
        self._moves = 0
        self._timestep = 0
        self._last = Motion()
        self._way: UncertainMotion | None = None  # to the formation position, since the last look by forecast and moves
        self._viewpoints: list[float] | None = None  # those still to be visited; None: not chosen yet

    def restart(self, timestep: int, step: UncertainMotion | None = None) -> None:
        """Begin a timestep: the neighbour has made its step."""
        self._moves = 0
        self._timestep = timestep
        self._last = Motion()
        self._expected_rad = None
        if timestep == 0:
            return
        self._viewpoints = []
        step = step or UncertainMotion(Motion())
        self._way = None if self._way is None else self._way.then(step)
        neighbours = step.between(self._formation, self._formation.inverse())
        self._check.stepped(neighbours.mean.yaw_rad)
        self._stepped = True
        self._filter.neighbour_stepped(neighbours, self._actuation.drives_so_far, timestep == 1)

    def neighbour_corrects(self) -> None:
        """The neighbour may have moved since the last look: it corrects at the same time."""
        self._filter.neighbour_corrects(_CORRECTION_SIGMA_M)

    def turn(self, forecast_rad: float) -> float:
        """Return the turn [rad] to make with the prediction move."""
        if not self._filter.known:
            return 0.0
        heading = pose_of(self._filter.best.state).then(self._formation).yaw_rad
        return heading if abs(heading) > self._p.turn_rad else 0.0

    def moved(self, asked: Motion, motion: Motion) -> None:
        """Process a measured move."""
        self._filter.moved(motion)
        self._actuation.moved(asked, motion)
        self._last = motion
        if self._expected_rad is not None:
            self._expected_rad -= motion.yaw_rad
        self._way = None if self._way is None else self._way.after(motion)

    def caught_up_rad(self) -> float:
        """See `AlignmentMode`: a check may find that the neighbour has turned otherwise since the one before."""
        return self._check.caught_up_rad

    def offset(self) -> UncertainMotion | None:
        """Estimate the way to the formation position in the follower's frame."""
        if not self._filter.known:
            return None
        best = self._filter.best
        by_pose, _ = composition_jacobians(pose_of(best.state), self._formation)
        covariance = by_pose @ best.covariance[:3, :3] @ by_pose.T
        return UncertainMotion.of(pose_of(best.state).then(self._formation), covariance)

    def ahead(self) -> UncertainMotion | None:
        """Estimate that way without a look: from the last look on, by forecasts and moves."""
        return self._way

    def assess(self, frames: Frames) -> Decision:
        """Decide what the last look calls for."""
        boxes = self._boxes(frames)
        strange = bool(boxes) and self._strange(boxes)
        if strange and self._search.looks >= self._p.search.hold_looks and self._filter.whole(boxes):
            # What doesn't fit for so long is not in the way: the neighbour, or the follower, was moved.
            self._filter.forget()
            self._expected_rad = self._way = None
            self._stepped = strange = False
        if not boxes or strange:
            if self._expected_rad is not None and self._viewpoints:
                self._viewpoints.pop(0)  # nothing to be seen from there
            offset = self.offset()
            decision = self._search.missed(self._last if self._moves else Motion(), offset.mean if offset else None)
            self._moves += count_legs(decision.motion)
            return decision
        self._search.found()
        first = not self._filter.known
        expected_rad = 0.0 if first else float(self._filter.best.state[YAW])
        self._filter.look(boxes)
        if not first:
            self._check_heading(boxes, expected_rad)
        self._way = self.offset()
        if first and set(boxes) == {Face.TARGET} and self._placed(self._filter.best.state):
            self._filter.assume_heading(self._p.placed_heading_rad)
            self._viewpoints = []
        return self._correct()

    def _check_heading(self, boxes: dict[Face, FaceBox], expected_rad: float) -> None:
        """Begin or end a check of the heading by what the latest look shows.

        Args:
            boxes: the look.
            expected_rad: the heading that was expected of it.
        """
        if self._stepped and self._check.due(self._deviation(), self._filter.yaw_sigma_rad):
            self._expected_rad, self._viewpoints, self._doubted = expected_rad, None, False
        self._stepped = False
        two_faces = len(boxes) > 1 and min(box.width for box in boxes.values()) >= _SECOND_FACE_PX
        if self._expected_rad is not None and two_faces:
            self._end_check()

    def _end_check(self) -> None:
        if self._expected_rad is not None:
            self._check.done(float(self._filter.best.state[YAW]) - self._expected_rad)
        self._expected_rad, self._viewpoints = None, []

    def _to_check(self, state: Vector) -> tuple[Motion, str]:
        """Choose the next motion of a check; none where it has ended, or can't be made."""
        motion, reason = self._to_see_more(state)
        if motion != Motion():
            if not self._doubted:
                self._filter.doubt_heading(self._p.heading_check.doubt_rad)
            self._doubted = True
        elif self._doubted and not self._viewpoints:
            self._end_check()  # no second face from anywhere: so the heading is about as expected
        else:
            self._expected_rad, self._viewpoints = None, []  # still called for in the next timestep
        return motion, reason

    def _deviation(self) -> Deviation | None:
        """Return how far aside of its forecast the neighbour's step ended; None where either is unknown."""
        expected, found = self._way, self.offset()
        if expected is None or found is None:
            return None
        sigma_m = max(_LEAST_FORECAST_SIGMA_M, math.sqrt(max(0.0, float(expected.matrix[1, 1]))))
        return Deviation(found.mean.y_m - expected.mean.y_m, sigma_m)

    def _correct(self) -> Decision:
        p, state = self._p, self._filter.best.state
        unsure = self._filter.yaw_sigma_rad > p.certain_rad
        motion, reason = Motion(), ""
        if self._expected_rad is not None:
            motion, reason = self._to_check(state)
        elif unsure and self._timestep == 0 and self._viewpoints != []:
            motion, reason = self._to_see_more(state)
        if motion == Motion():
            if self._within(pose_of(state).then(self._formation)):
                return Decision(Verdict.ALIGNED, reason="inside the tolerances")
            motion, reason = self._to_formation(state)
        if motion == Motion():
            return Decision(Verdict.UNALIGNED, reason="no way to the formation position keeps clear of the neighbour")
        if self._moves + count_legs(motion) > p.max_moves:
            return Decision(Verdict.UNALIGNED, reason=f"not aligned after {self._moves} moves")
        self._moves += count_legs(motion)
        return Decision(Verdict.MOVE, self._actuation.compensated(motion), reason)

    def _to_see_more(self, state: Vector) -> tuple[Motion, str]:
        """Choose the next motion to a place from where the heading shows; none if too few moves would be left."""
        motion, reason = self._first(state)
        if motion != Motion():
            return motion, reason
        states = self._filter.likely()
        for viewpoint in self._places(state):
            motion = self._outside_deadband(self._planner.next(states, viewpoint), _VIEWPOINT_TOLERANCE)
            if motion == Motion():
                continue
            left = self._outside_deadband(pose_of(after_motion(state, motion)).then(self._formation), self._deadband())
            needed = count_legs(motion) + self._planner.moves(left) + _SPARE_MOVES
            affordable = self._p.max_moves - self._moves >= min(needed, _ENOUGH_MOVES)
            return (motion, "to see two faces") if affordable else (Motion(), "")
        return Motion(), ""

    def _to_formation(self, state: Vector) -> tuple[Motion, str]:
        """Choose the next motion to the formation position and say why."""
        motion, reason = self._first(state)
        if motion != Motion():
            return motion, reason
        motion = self._planner.next(self._filter.likely(), self._formation)
        return self._outside_deadband(motion, self._deadband()), "to the formation position"

    def _first(self, state: Vector) -> tuple[Motion, str]:
        """Choose what comes before any goal: to keep clear, and to face a marker whose heading is hardly known."""
        states = self._filter.likely()
        if not self._planner.apart(state) and (away := self._planner.away(states)) != Motion():
            return away, "too close: away along u"
        unknown = self._filter.yaw_sigma_rad > _UNKNOWN_HEADING_RAD and self._expected_rad is None
        if unknown and abs(math.atan2(state[X], state[Y])) > _ASIDE_RAD:
            return self._planner.face(states), "turn towards the marker"
        return Motion(), ""

    def _deadband(self) -> Motion:
        p = self._p
        share = _DEADBAND if self._timestep > 0 else _FIRST_DEADBAND * p.first_share
        return Motion(share * p.v_tolerance_m, share * p.u_tolerance_m, _TURN_DEADBAND * p.heading_tolerance_rad)

    def _boxes(self, frames: Frames) -> dict[Face, FaceBox]:
        last = frames[-self._p.averaged_frames :]
        return mean_boxes([self._filter.plausible(blocks) for blocks in last])

    def _strange(self, boxes: dict[Face, FaceBox]) -> bool:
        """Whether a look shows no whole marker, or one where none is expected."""
        return not self._filter.whole(boxes) or (self._filter.known and self._filter.nis(boxes) >= _IMPLAUSIBLE_NIS)

    def _placed(self, state: Vector) -> bool:
        return math.hypot(state[X] + self._formation.x_m, state[Y] + self._formation.y_m) < self._p.placed_m

    def _within(self, way: Motion) -> bool:
        p = self._p
        share = 1.0 if self._timestep > 0 else p.first_share
        return (
            abs(way.y_m) <= share * p.u_tolerance_m
            and abs(way.x_m) <= share * p.v_tolerance_m
            and abs(way.yaw_rad) <= p.heading_tolerance_rad
        )

    @staticmethod
    def _outside_deadband(motion: Motion, deadband: Motion) -> Motion:
        """Leave out legs that are hardly worth a move."""
        turn, forward, left = motion.legs
        return Motion.from_legs(
            turn if abs(turn) > deadband.yaw_rad else 0.0,
            forward if abs(forward) > deadband.x_m else 0.0,
            left if abs(left) > deadband.y_m else 0.0,
        )

    def _places(self, state: Vector) -> Iterator[Motion]:
        """Yield the places left to look from, behind and ahead in turn; the one that is asked beyond is done with.

        The outer edges of Front and Rear are biased alike, so that the two sides' errors in heading cancel.
        """
        if self._viewpoints is None:
            if self._timestep > 0:
                self._viewpoints = list(_CHECK_PLACES_M)
            else:
                behind = pose_of(state).x_m > 0.0
                self._viewpoints = [-place if behind else place for place in _VIEWPOINTS_M]
        while self._viewpoints:
            yield Motion(self._viewpoints[0], self._formation.y_m + _VIEWPOINT_NEARER_M, 0.0)
            self._viewpoints.pop(0)
