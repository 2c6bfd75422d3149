"""What the world refuses, with the sentences that say why."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_formation.errors import FormationError
from robot_formation.names import WHEELS
from robot_formation.parameters import suggestion
from robot_formation.surface import Surface
from robot_formation.world.parameters import MotorParameters, WorldParameters
from robot_formation.world.pose import off_plate
from robot_formation.world.start import RobotStart

Command = tuple[tuple[float, ...], tuple[float, ...]]


class WorldError(FormationError):
    """A setup, command or request that the world refuses; nothing has moved."""


def check_setup(surface: Surface, robots: Sequence[RobotStart], parameters: WorldParameters, seed: int) -> None:
    """Check what a world is to be made of.

    Raises:
        WorldError: if names repeat, lockstep names an unknown robot, the seed is negative, or a robot would start with
            its reference dot beyond the plate's edge.
    """
    names = [robot.name for robot in robots]
    for name in names:
        if not name or names.count(name) > 1:
            raise WorldError(f"robot names must be non-empty and different; '{name}' is not")
    for name in parameters.lockstep:
        if name not in names:
            raise WorldError(f"world: 'lockstep' names no robot '{name}'{suggestion(name, names)}")
    if seed < 0:
        raise WorldError(f"the seed must be 0 or larger, not {seed}")
    for robot in robots:
        place = off_plate(surface, robot.pose(surface, parameters), parameters.marker.top_m)
        if place is not None:
            raise WorldError(
                f"robot '{robot.name}' can't start: its reference dot would be at ({place[0]:.2f}, {place[1]:.2f}) m, "
                f"beyond the plate of {surface.size_m:g} x {surface.size_m:g} m; "
                "move or turn the formation, or take fewer followers"
            )


def check_command(robot: str, angles: Sequence[float], speeds: Sequence[float], motor: MotorParameters) -> Command:
    """Return wheel angles (rad) and speed limits (rad/s) as tuples of floats.

    Raises:
        WorldError: on a wrong number of values, one that is not finite, or one beyond the motor's limits.
    """
    checked = tuple(float(value) for value in angles), tuple(float(value) for value in speeds)
    if any(len(values) != len(WHEELS) for values in checked):
        raise WorldError(
            f"robot '{robot}': a command needs four wheel angles and four speed limits, "
            f"not {len(checked[0])} and {len(checked[1])}"
        )
    if not all(math.isfinite(value) for values in checked for value in values):
        raise WorldError(f"robot '{robot}': wheel angles and speed limits must be finite numbers")
    for angle, speed in zip(*checked, strict=True):
        if abs(angle) > motor.max_angle_rad:
            raise WorldError(
                f"robot '{robot}': a wheel angle of {angle:g} rad is beyond {motor.max_angle_rad:g} rad; split it"
            )
        if angle != 0.0 and not 0.0 < speed <= motor.max_speed_rad_s:
            raise WorldError(
                f"robot '{robot}': a speed limit of {speed:g} rad/s is outside what the motor can do; "
                f"give more than 0 and at most {motor.max_speed_rad_s:g} rad/s"
            )
    return checked
