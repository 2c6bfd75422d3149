"""Whether the robots can follow the leader's path: within the drives' range, apart, in view and on the plate.

All of it is geometry of the rigid formation, known before anything moves.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.experiment.path_plan import STRAIGHT, formation, swept_by
from robot_formation.experiment.slot_check import LEAST_GAP_M, check_slots, sees_target
from robot_formation.geometry.footprint import footprint_gap_m
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import Slots, leader_places
from robot_formation.leader.leader_motion import LeaderParameters
from robot_formation.leader.paths import LeaderPath, PathKind
from robot_formation.leader.rigid_formation import Formation, Track, around, centred_start, follower_step, track_of
from robot_formation.parameters import ParameterError, from_mapping, to_mapping
from robot_formation.surface import plate_size

_LENGTHS = ("amplitude_m", "step_m", "radius_m", "length_m")
_SMALLER = tuple(0.95 - 0.05 * n for n in range(19))
_LARGER = (1.25, 1.5, 2.0, 3.0, 5.0, 10.0)
_MOST_TRIED = 1000
"""Timesteps up to which it is tried what would fit."""
_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Problem:
    """Why a path can't be followed: which robot, in which timestep, and what is wrong, as a sentence's end."""

    robot: str
    timestep: int
    text: str
    plate: bool = False


@dataclass(frozen=True)
class PathCheck:
    """What a path is checked against.

    Attributes:
        leader: the leader's parameters, its path among them.
        world: the robots' bodies, markers, cameras and starts, and the plate.
        drive: for the range.
        slots: the followers' places, each in its neighbour's frame.
        chosen: whether the start was chosen for the path.
    """

    leader: LeaderParameters
    world: WorldNodeParameters
    drive: DriveParameters
    slots: Slots
    chosen: bool

    def require(self) -> None:
        """Check the path.

        Raises:
            ParameterError: with one line that says which robot fails in which timestep, and what would fit.
        """
        path = self.leader.make_path()
        check_slots(self.slots, self.world, path.motion(1) if self.leader.path == STRAIGHT else Motion())
        self._require_start(path)
        problem = self.problem(path)
        if problem is None:
            return
        when = f"in timestep {problem.timestep}" if problem.timestep else "at the start"
        raise ParameterError(
            f"path '{self.leader.path}': {problem.robot} {problem.text} {when}{self._remedy(path, problem)}"
        )

    def _require_start(self, path: LeaderPath) -> None:
        """Check that the robots of a chain stand on the plate over their whole width, and with all wheels where they
        are not abreast.

        The paper's tracks begin with all rear wheels at the edge; with those of one side beyond it a robot turns and
        pushes the others.
        """
        abreast = all(place.x_m == 0.0 for place in self.slots)
        if (len(self.slots) < 2 and abreast) or self.chosen or not self.world.leaving_ends_run:
            return
        start = self._start(path)
        wheels_m = 0.0 if abreast else self.world.wheels.wheelbase_m
        whole = replace(formation(self.world, self.slots), length_m=wheels_m)
        pose = np.array([(start.x_m, start.y_m, start.yaw_rad)])
        for number, robot in enumerate(self._robots):
            box = whole.boxes(pose, [number])
            if self._off(box)[0]:
                size_m = _up(float(box.max()))
                fewer = "fewer followers, " if len(self.slots) > 1 else ""
                larger = f" or a plate of {size_m:.2f} m (world.surface_parameters=[size_m={size_m:.2f}])"
                raise ParameterError(
                    f"{robot} would stand with a part of its body beyond the plate of {self._plate_m:g} x "
                    f"{self._plate_m:g} m; take {fewer}another {self._start_on_plate(start, whole)}"
                    f"{larger if size_m > self._plate_m and box.min() >= 0.0 else ''}"
                )

    def _start_on_plate(self, start: Motion, whole: Formation) -> str:
        """Say from where all of a formation stands on the plate, whole centimetres, as far as it does."""
        low_x, high_x, low_y, high_y = map(float, whole.boxes(np.array([(start.x_m, start.y_m, start.yaw_rad)]))[0])
        if max(high_x - low_x, high_y - low_y) > self._plate_m:
            return "start_x_m and start_y_m"
        chosen = []
        for name, now, low, high in (("start_x_m", start.x_m, low_x, high_x), ("start_y_m", start.y_m, low_y, high_y)):
            if low < 0.0:
                chosen.append(f"{name}={_up(now - low):g}")
            elif high > self._plate_m:
                chosen.append(f"{name}={-_up(high - self._plate_m - now):g}")
        return f"start ({', '.join(chosen)} would do)"

    def problem(self, path: LeaderPath) -> Problem | None:
        """Find the first reason why a path can't be followed; None if it can."""
        # Steps that are the same are checked once.
        steps: dict[tuple[float, ...], tuple[Motion, int]] = {}
        for timestep in range(1, self.leader.timesteps + 1):
            step = path.motion(timestep)
            steps.setdefault(tuple(round(part, 9) for part in (step.x_m, step.y_m, step.yaw_rad)), (step, timestep))
        found = (problem for step, timestep in steps.values() for problem in self._of_step(step, timestep))
        return next(found, None) or self._off_plate(path)

    def _of_step(self, step: Motion, timestep: int) -> Iterator[Problem]:
        steps = [follower_step(step, place) for place in leader_places(self.slots)]
        for robot, own in zip(self._robots, steps, strict=True):
            if text := self._beyond_range(own):
                yield Problem(robot, timestep, text)
        if self.leader.path == STRAIGHT:
            return
        for robot, place, own, neighbour in zip(self._robots[1:], self.slots, steps[1:], steps, strict=False):
            if self._least_gap_m(place, own, neighbour) < LEAST_GAP_M:
                yield Problem(robot, timestep, "and its neighbour would come within a centimetre of each other")
            if not sees_target(self.world, place, neighbour):
                yield Problem(robot, timestep, "would not have its neighbour's marker in its camera's view")

    @property
    def _robots(self) -> list[str]:
        return [names.LEADER, *(names.follower(n) for n in range(1, len(self.slots) + 1))]

    def _beyond_range(self, step: Motion) -> str:
        turn, forward, left = step.legs
        for what, amount, most, unit in (
            ("along v", forward, self.drive.max_v_m, "m"),
            ("along u", left, self.drive.max_u_m, "m"),
            ("in a turn", turn, self.drive.max_turn_rad, "rad"),
        ):
            if abs(amount) > most + _TOLERANCE:
                digits = 3 if round(abs(amount), 3) > most else 4
                return (
                    f"would move {abs(amount):.{digits}f} {unit} {what}, beyond the drive's range of {most:g} {unit},"
                )
        return ""

    def _least_gap_m(self, place: Motion, own: Motion, neighbour: Motion) -> float:
        """Least gap of the two bodies while first the neighbour and then the follower makes its legs, metres.

        Where it can't be small, a lower bound of it.
        """
        length_m, width_m = self.world.chassis.length_m, self.world.chassis.width_m
        swing_m = math.hypot(length_m, width_m) * (abs(own.yaw_rad) + abs(neighbour.yaw_rad))
        bound_m = place.u_m - width_m - abs(own.y_m) - abs(neighbour.y_m) - swing_m
        if bound_m > LEAST_GAP_M:
            return bound_m
        there = place.inverse()
        gaps = [footprint_gap_m(there.then(at), length_m, width_m) for at in _legs(neighbour)]
        after = there.then(neighbour)
        gaps += [footprint_gap_m(after.relative_to(at), length_m, width_m) for at in _legs(own)]
        return min(gaps)

    def _off_plate(self, path: LeaderPath) -> Problem | None:
        """Find the first body beyond the plate's edge; on a straight path the first reference dot, like the world."""
        if self.leader.path == STRAIGHT and not self.world.leaving_ends_run:
            return None
        if self.chosen:
            return self._larger_than_plate(path)
        track = track_of(path, self.leader.timesteps, self._start(path))
        first = int((off := self._off(self._whole.boxes(track))).argmax())
        return self._leaves(track[first], first) if off.any() else None

    def _larger_than_plate(self, path: LeaderPath) -> Problem | None:
        """Find the first timestep in which what a formation has swept is larger than the plate, wherever it starts."""
        fitting, swept = self._timesteps_that_fit(path), self._swept(path)
        if fitting == len(swept) - 1:
            return None
        first = fitting + 1
        track = track_of(path, first, self._start(path))
        for number, robot in enumerate(self._robots):
            if (self._whole.boxes(track[-1:], [number])[0] == swept[first]).any():
                return Problem(robot, first, self._beyond, plate=True)
        return Problem(names.LEADER, first, self._beyond, plate=True)

    def _leaves(self, pose: NDArray[np.float64], timestep: int) -> Problem:
        """Say which robot is off the plate with the leader at a pose."""
        off = [self._off(self._whole.boxes(pose[None], [number]))[0] for number in range(len(self.slots) + 1)]
        return Problem(self._robots[off.index(True)], timestep, self._beyond, plate=True)

    @property
    def _beyond(self) -> str:
        return f"would leave the plate of {self._plate_m:g} x {self._plate_m:g} m"

    def _off(self, boxes: Track) -> NDArray[np.bool_]:
        """Tell for each box whether it reaches beyond the plate."""
        lowest, highest = boxes[:, ::2].min(axis=1), boxes[:, 1::2].max(axis=1)
        return np.asarray((lowest < -_TOLERANCE) | (highest > self._plate_m + _TOLERANCE))

    @property
    def _whole(self) -> Formation:
        whole = formation(self.world, self.slots)
        return replace(whole, length_m=0.0, width_m=0.0) if self.leader.path == STRAIGHT else whole

    @property
    def _plate_m(self) -> float:
        return plate_size(self.world.surface, self.world.surface_parameters)

    def _start(self, path: LeaderPath) -> Motion:
        """Return where the leader stands at the start of a path, world x, y and heading."""
        x_m, y_m, heading = self.world.start_x_m[0], self.world.start_y_m[0], self.world.start_heading_rad[0]
        if self.chosen:
            x_m, y_m = centred_start(swept_by(path, self.leader.timesteps, self._whole, heading), self._plate_m)
        return Motion(x_m, y_m, heading)

    def _remedy(self, path: LeaderPath, problem: Problem) -> str:
        """Say what would fit, as far as it can be found by trying."""
        ways = self._tried(path, plate=problem.plate)
        if problem.plate and (size_m := self._plate_that_fits(path)):
            ways.append(f"a plate of {size_m:.2f} m (world.surface_parameters=[size_m={size_m:.2f}])")
        if problem.plate and (timesteps := self._timesteps_that_fit(path)) > 0:
            ways.append(f"leader.timesteps={timesteps}")
        return f"; {' or '.join(ways)} would fit" if ways else ""

    def _tried(self, path: LeaderPath, *, plate: bool) -> list[str]:
        """Find for each length of the path's own the largest smaller one that fits, or a longer period or radius."""
        if not isinstance(path, PathKind) or self.leader.timesteps > _MOST_TRIED:
            return []
        tries = [(name, _SMALLER) for name in _LENGTHS if plate or name != "radius_m"]
        tries += [] if plate else [(name, _LARGER) for name in ("radius_m", "period")]
        own = to_mapping(path)
        return [text for name, factors in tries if own.get(name) and (text := self._fitting(path, name, factors))]

    def _fitting(self, path: PathKind, name: str, factors: Sequence[float]) -> str:
        """Find the first factor on a parameter that fits, if all after it do too; return the parameter's text."""
        own = to_mapping(path)
        values = [float(f"{factor * own[name]:.2g}") for factor in factors]

        def fits(value: float) -> bool:
            with suppress(ParameterError):
                return self.problem(from_mapping(type(path), {**own, name: value}, where="path")) is None
            return False

        if not fits(values[-1]):
            return ""
        return f"{name}={values[bisect_left(values, True, hi=len(values) - 1, key=fits)]:g}"

    def _plate_that_fits(self, path: LeaderPath) -> float | None:
        """Find the least plate on which the path fits, whole centimetres; None if its start is off any."""
        low_x, high_x, low_y, high_y = map(float, self._swept(path)[-1])
        if self.chosen:
            return _up(max(high_x - low_x, high_y - low_y))
        return None if min(low_x, low_y) < 0.0 else _up(max(high_x, high_y))

    def _timesteps_that_fit(self, path: LeaderPath) -> int:
        """Find how many timesteps fit; 0 if none do, or -1 if not even the start does."""
        swept = self._swept(path)
        if self.chosen:
            sides = np.maximum(swept[:, 1] - swept[:, 0], swept[:, 3] - swept[:, 2])
            fits = sides <= self._plate_m + _TOLERANCE
        else:
            fits = ~self._off(swept)
        return int(np.count_nonzero(fits)) - 1

    def _swept(self, path: LeaderPath) -> Track:
        """Box around all bodies up to the end of each timestep, in the world if the start isn't chosen."""
        start = self._start(path)
        track = track_of(path, self.leader.timesteps, start)
        return around(self._whole.boxes(track))


def _legs(step: Motion) -> tuple[Motion, ...]:
    """List the poses after each leg of a motion, in the frame of its start."""
    turn, forward, _ = step.legs
    return Motion.from_legs(turn, 0.0, 0.0), Motion.from_legs(turn, forward, 0.0), step


def _up(length_m: float) -> float:
    return math.ceil(100.0 * length_m - 1e-6) / 100.0
