"""What is known of a run after it ended, wherever it comes from: a bag or the in-process runner."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.bag.run_details import node_parameters, said_slots, whole_number
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.geometry.slots import leader_places, slot
from robot_formation.json_values import JsonObject
from robot_formation.schedule.schedules import Spacing

DOT_HEIGHT_M = 0.216
"""Height of the reference dot above base_link (paper: the robot's height)."""
BODY_M = (0.365, 0.238)
"""Length and width of a robot (paper)."""


@dataclass(frozen=True)
class Stamped:
    """A displacement, the simulated time it is a fact of [ns], its covariances (u, u), (u, v), (v, v) [m^2], and the
    variance of its turn [rad^2]; negative if the turn isn't known.
    """

    stamp_ns: int
    motion: Motion
    covariance_uv: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_variance: float = 0.0

    @property
    def turn_rad(self) -> float | None:
        """The turn, anticlockwise; None if it isn't known."""
        return self.motion.yaw_rad if self.motion.finite and self.turn_variance >= 0.0 else None


@dataclass(frozen=True)
class Track:
    """True poses of a robot's base_link in the world, in order of time.

    Attributes:
        stamps_ns: (n,) nanoseconds.
        positions_m: (n, 3) x, y, z.
        yaws_rad: (n,) heading, anticlockwise from world x.
        tilts: (n, 2) x and y of base_link's z axis, a unit vector; None: upright.
    """

    stamps_ns: NDArray[np.int64]
    positions_m: NDArray[np.float64]
    yaws_rad: NDArray[np.float64]
    tilts: NDArray[np.float64] | None = None

    def at(self, stamp_ns: int) -> Motion | None:
        """Return the last pose at or before the stamp in the world's plane, if there is any."""
        index = int(np.searchsorted(self.stamps_ns, stamp_ns, side="right")) - 1
        if index < 0:
            return None
        x_m, y_m = self.positions_m[index, :2].tolist()
        return Motion(x_m, y_m, float(self.yaws_rad[index]))

    @property
    def length_m(self) -> float:
        """Length of the path on the ground, metres."""
        return float(np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1).sum())


@dataclass(frozen=True)
class FollowerRecord:
    """A follower's part of a run.

    Attributes:
        name: follower_1, follower_2, ...
        moved: every move by its encoder wheels, stamped with its end.
        displacements: one per finished timestep.
        residuals: one per finished timestep: desired minus actual position as the camera estimates it; NaN if unseen.
        predictions: the k-th is for timestep k + 1.
        states: what its fine-tuner said, in order.
        state_stamps_ns: simulated time of each state; empty where unknown.
        commands: every move as it was commanded; the k-th of `moved` answers the k-th.
    """

    name: str
    moved: tuple[Stamped, ...] = ()
    displacements: tuple[Stamped, ...] = ()
    residuals: tuple[Stamped, ...] = ()
    predictions: tuple[Stamped, ...] = ()
    states: tuple[str, ...] = ()
    state_stamps_ns: tuple[int, ...] = ()
    commands: tuple[Motion, ...] = ()

    @property
    def lost(self) -> bool:
        """Whether it lost its beacon neighbour from view."""
        return any(AlignmentState.parse(text) is AlignmentState.LOST for text in self.states)


@dataclass(frozen=True)
class Ground:
    """The surface as a mesh: vertices (n, 3) in world metres, triangles (m, 3) of vertex numbers."""

    vertices_m: NDArray[np.float64]
    triangles: NDArray[np.int64]


@dataclass(frozen=True)
class OverheadTrack:
    """Where the overhead tracker saw a robot's reference dot, and where the dot truly was: world, metres.

    Attributes:
        stamps_ns: (n,) nanoseconds, in order.
        seen_m: (n, 3) x, y, z as tracked.
        true_m: (n, 3) x, y, z by ground truth.
    """

    stamps_ns: NDArray[np.int64]
    seen_m: NDArray[np.float64]
    true_m: NDArray[np.float64]

    @property
    def errors_m(self) -> NDArray[np.float64]:
        """Distances (n,) between the two in world x, y, metres."""
        return np.asarray(np.linalg.norm(self.seen_m[:, :2] - self.true_m[:, :2], axis=1))


@dataclass(frozen=True)
class RunRecord:
    """A run.

    Attributes:
        leader_moved: the leader's moves; the k-th opens timestep k.
        followers: by number.
        tracks: true path by robot; may be empty.
        simulated_s: simulated seconds from the first to the last record.
        details: what the run says of itself (scenario, seed, predictor, surface, timesteps, ...), as text.
        ground: the surface's mesh if it is known.
        overhead: what the overhead tracker saw, by robot; empty without one.
        left_plate: robots whose reference dot has left the plate.
    """

    leader_moved: tuple[Stamped, ...]
    followers: tuple[FollowerRecord, ...]
    tracks: Mapping[str, Track] = field(default_factory=dict)
    simulated_s: float = 0.0
    details: Mapping[str, str] = field(default_factory=dict)
    ground: Ground | None = None
    overhead: Mapping[str, OverheadTrack] = field(default_factory=dict)
    left_plate: tuple[str, ...] = ()

    @cached_property
    def _parameters(self) -> dict[str, JsonObject]:
        """The parameters of the run's nodes, read once: they are long."""
        return node_parameters(self.details)

    @property
    def timesteps_planned(self) -> int | None:
        """Timesteps that the scenario has, if the run says."""
        return whole_number(self.details, "timesteps", 9)

    @property
    def dot_height_m(self) -> float:
        """Height of the reference dot above base_link, metres: what the run says, else the paper's robot's."""
        return self.said("world", "marker.top_m", DOT_HEIGHT_M)

    @property
    def body_m(self) -> tuple[float, float]:
        """Length and width of a robot, metres: what the run says, else the paper's."""
        length, width = (f"chassis.{side}_m" for side in ("length", "width"))
        return self.said("world", length, BODY_M[0]), self.said("world", width, BODY_M[1])

    @property
    def formation_distance_m(self) -> float:
        """Distance between neighbours abreast, metres: the run's fine-tuner's, else the paper's."""
        return self.said("fine_tuner", "formation_distance_m", FORMATION_DISTANCE_M)

    def place(self, follower: str) -> Motion:
        """Return a follower's place in its neighbour's frame: what the run says, else beside it."""
        number = names.follower_number(follower)
        slots = said_slots(self.details)
        return slot(*slots[number - 1]) if number <= len(slots) else slot(self.formation_distance_m)

    def leader_place(self, follower: str) -> Motion:
        """Return a follower's place in the leader's frame, the sum of its own and those of the robots between."""
        numbers = range(1, names.follower_number(follower) + 1)
        return leader_places([self.place(names.follower(number)) for number in numbers])[-1]

    @property
    def delayed(self) -> bool:
        """Whether followers keep their places beside where their neighbours stood one timestep earlier."""
        fine_tuner = self._parameters.get("fine_tuner", {})
        return fine_tuner.get("spacing") == Spacing.DELAYED.value

    def said(self, node: str, name: str, default: float) -> float:
        """Return a node's parameter as the run says it; the default if it says none, or no finite number above 0."""
        try:
            said = float(self._parameters[node][name])
        except (KeyError, ValueError, TypeError, OverflowError):
            return default
        return said if math.isfinite(said) and said > 0.0 else default
