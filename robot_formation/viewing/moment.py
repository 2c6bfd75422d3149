"""What a viewer shows at one instant, whether of a bag or of a run that goes on; plain values, and words for them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.quantiles import ELLIPSE_90
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.orientation import Quaternion, Vector, yaw_rad
from robot_formation.geometry.se2 import Motion

Picture = NDArray[np.uint8]
"""RGB (rows, columns, 3)."""

_WORDS = {
    AlignmentState.ALIGN: "takes its place at the start",
    AlignmentState.COLLECT: "first move of a timestep of the collection phase",
    AlignmentState.PREDICT: "makes the move that was predicted",
    AlignmentState.BLIND: "makes the move that was predicted, without the camera",
    AlignmentState.CORRECT: "corrects its place",
    AlignmentState.HOLD: "does not see its neighbour and looks again",
    AlignmentState.SEARCH: "searches its neighbour",
    AlignmentState.REACQUIRED: "sees its neighbour again",
    AlignmentState.ALIGNED: "is in its place",
    AlignmentState.UNALIGNED: "has used up its corrections",
    AlignmentState.LOST: "has lost its neighbour",
}


@dataclass(frozen=True)
class RobotPose:
    """A robot's true pose in the world, and the angle of each wheel by its joint's name, radians."""

    position_m: Vector
    orientation: Quaternion
    joints_rad: Mapping[str, float] = field(default_factory=dict)

    @property
    def planar(self) -> Motion:
        """The pose seen from above."""
        return Motion(self.position_m[0], self.position_m[1], yaw_rad(self.orientation))


def finite_angles(joints: Iterable[str], positions: Iterable[float]) -> dict[str, float]:
    """Return the angles that are numbers, by joint."""
    return {joint: float(angle) for joint, angle in zip(joints, positions, strict=False) if math.isfinite(angle)}


@dataclass(frozen=True)
class Forecast:
    """The next displacement as the predictor tells it.

    Attributes:
        start: the follower's pose in the world when it was told.
        mean: the displacement.
        covariance_uv: of (u, u), (u, v), (v, v), m^2.
    """

    start: Motion
    mean: Motion
    covariance_uv: tuple[float, float, float]

    @property
    def end(self) -> Motion:
        """Where the displacement leads, in the world."""
        return self.start.then(self.mean)

    def ellipse(self, points: int = 48) -> NDArray[np.float64]:
        """Return the 90 % ellipse of the place where it ends, world x and y: (points, 2); one place if it is exact."""
        uu, uv, vv = self.covariance_uv
        values, axes = np.linalg.eigh(np.array([[vv, -uv], [-uv, uu]]))  # x = v, y = -u
        angles = np.linspace(0.0, math.tau, points)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        local = (circle * np.sqrt(ELLIPSE_90 * np.maximum(values, 0.0))) @ axes.T
        cosine, sine = math.cos(self.start.yaw_rad), math.sin(self.start.yaw_rad)
        turned = local @ np.array([[cosine, sine], [-sine, cosine]])
        return np.asarray(turned + np.array((self.end.x_m, self.end.y_m)), float)


@dataclass(frozen=True)
class TimestepFigures:
    """What a finished timestep came to: correction distance and formation error, metres; None where unknown."""

    t: int
    correction_m: float | None
    error_m: float | None


@dataclass(frozen=True)
class FollowerNow:
    """A follower at an instant.

    Attributes:
        state: what its fine-tuner said last.
        finished: timesteps that it has finished.
        place: in formation, in the world; None where it isn't known.
        forecast: of its next displacement, if there is one.
    """

    state: str = ""
    finished: int = 0
    place: Motion | None = None
    forecast: Forecast | None = None

    @property
    def words(self) -> str:
        """What it does, for people: the state, and its reason if there is one."""
        state = AlignmentState.parse(self.state)
        if state is None:
            return self.state or "has not begun"
        reason = self.state.partition(":")[2].strip()
        return f"{_WORDS[state]} ({reason})" if reason else _WORDS[state]


@dataclass(frozen=True)
class Moment:
    """An instant of a run: simulated time, robots and followers by name."""

    stamp_ns: int
    robots: Mapping[str, RobotPose] = field(default_factory=dict)
    followers: Mapping[str, FollowerNow] = field(default_factory=dict)


def figures_in_words(figures: Sequence[TimestepFigures]) -> str:
    """Return the last timestep's figures for people, centimetres; nothing without any."""
    if not figures:
        return ""
    last = figures[-1]
    parts = []
    if last.error_m is not None:
        parts.append(f"formation error {100.0 * last.error_m:.2f} cm")
    if last.correction_m is not None:
        parts.append(f"correction {100.0 * last.correction_m:.1f} cm")
    return f"timestep {last.t}: {', '.join(parts)}" if parts else f"timestep {last.t} is finished"
