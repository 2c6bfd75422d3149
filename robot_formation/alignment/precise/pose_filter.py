"""Estimate of the neighbour's pose from looks and known moves: a bank of iterated extended Kalman filters.

Bearing and distance follow from one look; the heading only from how the picture changes over known moves, and from
the faces beside the Target face. Until looks have decided, several headings are kept side by side (Gaussian sum
filter: Sorenson and Alspach, Automatica 7, 1971; iterated update: Bell and Cathey, IEEE TAC 38, 1993; weights of
stray edges: Huber, Robust Statistics, 1981).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robot_formation.alignment.observation import FaceBox
from robot_formation.alignment.precise.marker_edges import EdgeParameters, View, one_marker, view
from robot_formation.alignment.precise.marker_projection import (
    CURVATURE,
    SADDLE,
    SIZE,
    SKEW,
    YAW,
    MarkerModel,
    Matrix,
    Vector,
    X,
    Y,
    after_motion,
    relative_tilt,
)
from robot_formation.alignment.precise.pose_hypothesis import Hypothesis, LookUpdate
from robot_formation.alignment.precise.step_models import Drives, StepModel, StepModels, StepParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.parameters import parameter
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

# All chosen; docs/explanation/alignment.md ("Constants") says how far runs depend on some of them.
_KEPT_COST = 16.0
"""Hypotheses are kept up to so much more twice the negative log likelihood than the best has: four standard
deviations."""
_LIKELY_COST = 9.0
"""The same for those of which a move must keep clear: three standard deviations."""
_GATE_PX, _GATE_SIGMAS, _GATE_M_PER_RAD = 15.0, 3.0, 0.5
"""How far outside a hypothesis's picture a block may lie: at least so much, and by so many standard deviations of the
place, and so many metres per standard deviation [rad] of the heading."""
_NEAREST_M = 0.1
"""Least distance for which metres become pixels there."""
_MOST_INFLATION = 30.0
"""Bound on the factor by which a high NIS makes the step model's noise larger."""
_NIS_GAIN = 0.5
"""Share of the latest look in the running mean of the NIS after steps."""
_HYPOTHESES = 50
"""Most hypotheses: more than there are first guesses."""
_HEADINGS_DEG = range(-92, 93, 4)
"""Headings of the first guesses: from beyond the right angle at which the Target face vanishes, close enough together
for the update to converge from the nearest."""
_LIKELY_FIRST = sorted(_HEADINGS_DEG, key=abs)
"""The same headings in another order: a neighbour mostly heads as the follower does."""
_GUESS_SIGMA_M, _GUESS_SIGMA_RAD = 0.1, math.radians(3.0)
"""Standard deviations of a guess: of place, so that the first look decides it, and of heading, somewhat less than the
guesses' distance."""
_SAME_RAD = math.radians(1.5)
"""Hypotheses that come nearer than this in heading are one."""
_SWING_M_PER_RAD = 0.02
"""Standard deviation of the place after a measured turn, per radian."""
_DRIFT_WAY_M = 0.1
"""Length of the move that `yaw_drift_rad` is given for."""


@dataclass(frozen=True)
class FilterParameters:
    """How far the filter trusts moves, the ground and what it saw before."""

    curvature_sigma_per_m: float = parameter(
        0.15, "Mean curvature of the ground between the robots", unit="1/m", low=1e-4, high=10.0
    )
    curvature_drift_per_m: float = parameter(
        0.0015,
        "Change of the curvatures with each step of the neighbour; more where the NIS after steps is high",
        unit="1/m",
        low=0.0,
        high=10.0,
    )
    saddle_sigma_per_m: float = parameter(
        0.1,
        "Half of the difference between the ground's curvatures along and across",
        unit="1/m",
        low=1e-4,
        high=10.0,
    )
    skew_sigma_per_m: float = parameter(0.02, "Mixed part of the ground's curvature", unit="1/m", low=1e-4, high=10.0)
    move_sigma: float = parameter(0.02, "Error of a measured move, share of its length", low=0.0, high=1.0)
    move_floor_m: float = parameter(0.0007, "Error of a measured move, least", unit="m", low=0.0, high=0.1)
    turn_sigma: float = parameter(0.02, "Error of a measured turn, share of it", low=0.0, high=1.0)
    yaw_drift_rad: float = parameter(
        0.0022,
        "Turn by slip on a move of 10 cm, which the wheels don't measure; grows with the root of the way",
        unit="rad",
        low=0.0,
        high=1.0,
    )
    calm_nis: float = parameter(
        0.025,
        "Mean NIS of the first look after a step up to which the noise of the step model is not inflated",
        low=1e-4,
        high=100.0,
    )
    slip_per_tilt: float = parameter(
        0.76,
        "Sideways slip of a driving robot: share of its way per radian of lateral slope",
        unit="1/rad",
        low=0.0,
        high=100.0,
    )
    slip_growth: float = parameter(
        12.0,
        "How much that grows on the way down, per squared share by which drives go too far there",
        unit="1/rad",
        low=0.0,
        high=1000.0,
    )
    turn_growth: float = parameter(
        28.0,
        "Relative turn by slip on the way down: per way, tilt and squared share by which drives go too far",
        unit="1/(m rad)",
        low=0.0,
        high=1000.0,
    )
    step: StepParameters = StepParameters()


class PoseFilter:
    """Where the neighbour stands, as far as looks and moves tell."""

    def __init__(
        self,
        model: MarkerModel,
        edges: EdgeParameters,
        parameters: FilterParameters,
        least_leg_m: float = 0.0,
        wheel_lever_m: float = 0.0,
    ) -> None:
        self._model = model
        self._edges = edges
        self._looks = LookUpdate(model, edges)
        self._p = parameters
        self.hypotheses: list[Hypothesis] = []
        self._models = StepModels(parameters.step, least_leg_m, wheel_lever_m)
        self._nis = 0.0
        self._stepped = False

    @property
    def known(self) -> bool:
        """Whether there is any estimate."""
        return bool(self.hypotheses)

    @property
    def best(self) -> Hypothesis:
        """The likeliest hypothesis; only if there is one."""
        return self.hypotheses[0]

    @property
    def yaw_sigma_rad(self) -> float:
        """Standard deviation of the heading over all hypotheses."""
        weights = np.array([math.exp(-0.5 * (h.cost - self.best.cost)) for h in self.hypotheses])
        weights /= weights.sum()
        yaws = np.array([h.state[YAW] for h in self.hypotheses])
        inside = np.array([h.covariance[YAW, YAW] for h in self.hypotheses])
        mean = float(weights @ yaws)
        return math.sqrt(float(weights @ (inside + (yaws - mean) ** 2)))

    def likely(self) -> list[Vector]:
        """List the states that looks have not yet ruled out, the likeliest first."""
        return [h.state for h in self.hypotheses if h.cost <= self.best.cost + _LIKELY_COST]

    def forget(self) -> None:
        """Drop everything."""
        self.hypotheses = []

    def assume_heading(self, sigma_rad: float) -> None:
        """Condition on the assumption that the neighbour heads as the follower does, up to a standard deviation."""
        row = np.zeros((1, SIZE))
        row[0, YAW] = 1.0
        for hypothesis in self.hypotheses:
            innovation = -hypothesis.state[YAW]
            cost = _gain_update(hypothesis, row, np.array([innovation]), np.array([sigma_rad**2]))
            hypothesis.cost += cost
        self._prune()

    def doubt_heading(self, sigma_rad: float) -> None:
        """Take the heading for less certain than looks and forecasts made it, by an error of this deviation."""
        self._doubt((YAW,), sigma_rad)

    def neighbour_corrects(self, sigma_m: float) -> None:
        """Take the neighbour's position for less certain: it may have corrected its own since the last look."""
        self._doubt((X, Y), sigma_m)

    def _doubt(self, components: Sequence[int], sigma: float) -> None:
        variance = np.zeros((SIZE, SIZE))
        variance[components, components] = sigma**2
        for hypothesis in self.hypotheses:
            hypothesis.covariance = hypothesis.covariance + variance

    # --- moves ------------------------------------------------------------------------------------------------------

    def moved(self, motion: Motion) -> None:
        """Predict (EKF time update) by a move of the follower, as its encoders measured it."""
        p = self._p
        length = math.hypot(motion.x_m, motion.y_m)
        # The turn comes first: its error swings the way that follows.
        yaw = (p.turn_sigma * motion.yaw_rad) ** 2 + p.yaw_drift_rad**2 * length / _DRIFT_WAY_M
        place = p.move_floor_m**2 + (p.move_sigma * length) ** 2 + (_SWING_M_PER_RAD * motion.yaw_rad) ** 2
        noise = np.diag([place, place, yaw, 0.0, 0.0, 0.0])
        for hypothesis in self.hypotheses:
            self._propagate(hypothesis, motion, noise)

    def _propagate(self, hypothesis: Hypothesis, motion: Motion, noise: Matrix) -> None:
        state = hypothesis.state
        jacobian = np.eye(SIZE)
        c, s = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
        turn = np.array([[c, s], [-s, c]])
        jacobian[:2, :2] = turn
        jacobian[SADDLE:, SADDLE:] = turn.T @ turn.T  # by twice the angle, the other way
        moved = after_motion(state, motion)
        # A turn that was not measured moves the neighbour about the follower.
        swing = np.eye(SIZE)
        swing[X, YAW], swing[Y, YAW] = -moved[Y], moved[X]
        hypothesis.state = moved
        hypothesis.covariance = jacobian @ hypothesis.covariance @ jacobian.T + swing @ noise @ swing.T

    def neighbour_stepped(self, step: UncertainMotion, own: Drives, first: bool = False) -> None:
        """Predict (EKF time update) that the neighbour has made a step, by each of the step models.

        Args:
            step: the step as forecast, in the neighbour's frame at its start, with covariance.
            own: what the follower knows of its own drives.
            first: whether it is the first step, which is known beforehand.
        """
        models = self._models.models(step, own, self._inflation, first)
        tilt_rad = float(relative_tilt(self.best.state[None])[0][0]) if self.hypotheses else 0.0
        branch = not self._stepped  # without a look since the last step, nothing tells the models apart
        self._stepped = True
        found = []
        for hypothesis in self.hypotheses:
            for number, model in enumerate(models):
                if not branch and number != hypothesis.model:
                    continue
                cost = hypothesis.cost + (self._models.costs[number] if branch else 0.0)
                stepped = Hypothesis(hypothesis.state.copy(), hypothesis.covariance, cost, number)
                self._step(stepped, model, own, tilt_rad)
                found.append(stepped)
        self.hypotheses = sorted(found, key=lambda h: h.cost)

    @property
    def _inflation(self) -> float:
        """How much larger the step models' noise is than where they hold."""
        return min(_MOST_INFLATION, max(1.0, self._nis / self._p.calm_nis))

    def _step(self, hypothesis: Hypothesis, model: StepModel, own: Drives, tilt_rad: float) -> None:
        """Predict one hypothesis; `tilt_rad` is the relative tilt of the likeliest."""
        p, step = self._p, model.step
        overshoot = max(0.0, own.overshoot)
        slip = p.slip_per_tilt + p.slip_growth * overshoot**2
        state, covariance = hypothesis.state, hypothesis.covariance
        c, s = math.cos(state[YAW]), math.sin(state[YAW])
        along = np.array([[c, -s], [s, c]])
        # The neighbour slips as the follower does, and by as much more as it is tilted more.
        tilt = float(relative_tilt(state[None])[0][0]) - model.slip_included * tilt_rad
        aside = step.y_m - slip * tilt * (abs(step.x_m) + self._models.turning_way_m(step))
        jacobian = np.eye(SIZE)
        jacobian[:2, YAW] = along @ (-aside, step.x_m)
        state[:2] += along @ (step.x_m, aside)
        state[YAW] += step.yaw_rad + p.turn_growth * overshoot**2 * tilt * abs(step.x_m)
        noise = np.zeros((SIZE, SIZE))
        turned = np.eye(3)
        turned[:2, :2] = along
        noise[:3, :3] = turned @ model.covariance @ turned.T
        for part in (CURVATURE, SADDLE, SKEW):
            noise[part, part] = (p.curvature_drift_per_m * self._inflation) ** 2
        hypothesis.covariance = jacobian @ covariance @ jacobian.T + noise

    # --- looks ------------------------------------------------------------------------------------------------------

    def look(self, boxes: dict[Face, FaceBox]) -> None:
        """Update (EKF measurement update) by a look's boxes, at least one."""
        if self._stepped and self.hypotheses:
            self._nis += _NIS_GAIN * (self.nis(boxes) - self._nis)
        branched, self._stepped = self._stepped, False
        if not self.hypotheses:
            self.hypotheses = list(self._guesses(boxes))
        self._take(view(boxes, self._edges), branched)
        if not self.hypotheses:
            self.hypotheses = list(self._guesses(boxes))
            self._take(view(boxes, self._edges))

    def _take(self, seen: View, branched: bool = False) -> None:
        for hypothesis in self.hypotheses:
            self._looks.update(hypothesis, seen)
        if branched:
            self._models.judge(
                [(hypothesis.model, hypothesis.cost) for hypothesis in self.hypotheses if hypothesis.sane]
            )
        self._prune()

    def plausible(self, blocks: Sequence[Block]) -> list[Block]:
        """Leave out blocks that lie where no hypothesis expects their face: other objects of a marker colour."""
        if not self.hypotheses:
            return one_marker(blocks, lambda block: -block.width * block.height)
        expected = self._model.pixels(self.best.state[None])[0].mean(axis=0)
        kept = [block for block in blocks if any(self._expects(hypothesis, block) for hypothesis in self.hypotheses)]
        return one_marker(kept, lambda block: math.hypot(block.x - expected[0], block.y - expected[1]))

    def _expects(self, hypothesis: Hypothesis, block: Block) -> bool:
        if block.signature not in set(Face):
            return False
        corners = self._model.pixels(hypothesis.state[None])[0]
        place_m = math.sqrt(float(np.trace(hypothesis.covariance[:2, :2])))
        yaw_rad = math.sqrt(float(hypothesis.covariance[YAW, YAW]))
        spread_m = _GATE_SIGMAS * place_m + _GATE_M_PER_RAD * yaw_rad
        distance_m = max(_NEAREST_M, float(hypothesis.state[Y]))
        gate = _GATE_PX + self._model.parameters.focal_length_px * spread_m / distance_m
        low, high = corners.min(axis=0) - gate, corners.max(axis=0) + gate
        return bool(low[0] <= block.x <= high[0] and low[1] <= block.y <= high[1])

    def nis(self, boxes: dict[Face, FaceBox]) -> float:
        """Normalised innovation squared (NIS) of a look, per edge; 1 is expected of a consistent filter."""
        return self._looks.nis(self.hypotheses, view(boxes, self._edges))

    def whole(self, boxes: dict[Face, FaceBox]) -> bool:
        """Whether a look's boxes, at least one, fit together for some pose: not those of a partly covered marker."""
        seen = view(boxes, self._edges)
        return any(self._looks.fits(guess, seen) for guess in self._guesses(boxes, _LIKELY_FIRST))

    def _guesses(self, boxes: dict[Face, FaceBox], headings_deg: Sequence[int] = _HEADINGS_DEG) -> Iterator[Hypothesis]:
        """Make a guess of each heading, when it is asked for."""
        face = Face.TARGET if Face.TARGET in boxes else max(boxes, key=lambda f: boxes[f].height)
        box = boxes[face]
        ground = [self._p.curvature_sigma_per_m**2, self._p.saddle_sigma_per_m**2, self._p.skew_sigma_per_m**2]
        covariance = np.diag([_GUESS_SIGMA_M**2, _GUESS_SIGMA_M**2, _GUESS_SIGMA_RAD**2, *ground])
        for degrees in headings_deg:
            guess = self._model.place(face, box.x, box.height - self._edges.height_bias_px, math.radians(degrees))
            yield Hypothesis(guess, covariance)

    def _prune(self) -> None:
        """Keep the likely hypotheses, one of each kind, the best first."""
        kept: list[Hypothesis] = []
        self.hypotheses = [h for h in self.hypotheses if h.sane]
        for hypothesis in sorted(self.hypotheses, key=lambda h: h.cost):
            if hypothesis.cost > self._least() + _KEPT_COST:
                continue
            if all(abs(hypothesis.state[YAW] - other.state[YAW]) > _SAME_RAD for other in kept):
                kept.append(hypothesis)
        self.hypotheses = kept[:_HYPOTHESES]

    def _least(self) -> float:
        return min(h.cost for h in self.hypotheses)


def _gain_update(hypothesis: Hypothesis, h: Matrix, innovation: Vector, variance: Vector) -> float:
    """Kalman update in place; returns its cost."""
    covariance = hypothesis.covariance
    scatter = h @ covariance @ h.T + np.diag(variance)
    gain = np.linalg.solve(scatter, h @ covariance).T
    hypothesis.state = hypothesis.state + gain @ innovation
    hypothesis.covariance = covariance - gain @ h @ covariance
    return float(innovation @ np.linalg.solve(scatter, innovation))
