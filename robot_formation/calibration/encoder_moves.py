"""Encoder accuracy: preset distances, driven by a robot's curves and measured by three instruments.

Paper, section "Sensing system specifications and calibrations": travelled distance by the motors' encoders, by the
sensing system and by the one-point reference, along v and u.
"""

from __future__ import annotations

from collections.abc import Callable

from robot_formation.calibration.encoder_comparison import Travelled
from robot_formation.calibration.rig import LEGS, CalibrationRig, RobotOnRig
from robot_formation.drive.curves import calibrated, limits
from robot_formation.drive.movement_system import LEG_SIGNS, Drive, DriveParameters
from robot_formation.geometry.se2 import Motion

AXES = ("v", "u")
PRESETS = 10


def measure_encoders(
    rig: CalibrationRig,
    robot: str,
    drive: DriveParameters,
    repeats: int,
    say: Callable[[str], None] = lambda text: None,
) -> list[Travelled]:
    """Drive ten preset distances up to the calibrated range along v and u, forth and back, and measure each.

    Args:
        rig: where.
        robot: which robot; its curves in `drive.calibration_file` are used, if there is one.
        drive: parameters of its drive.
        repeats: how often each distance is driven forth and back.
        say: takes a line of progress per axis.

    Raises:
        CalibrationError: if the calibration can't be used or a drive not be measured.
    """
    parameters = calibrated(drive, robot)
    state_machine = Drive(parameters)
    found = []
    with RobotOnRig(rig, robot) as on_rig:
        for axis in AXES:
            presets = [limits(parameters)[axis] * (k / PRESETS) for k in range(1, PRESETS + 1)]
            for _ in range(repeats):
                for preset in presets:
                    for way in (preset, -preset):
                        found.append(_measure(on_rig, state_machine, axis, way, parameters.wheel_radius_m))
            say(f"{robot} {axis}: {2 * repeats * PRESETS} drives")
    return found


def _measure(robot: RobotOnRig, drive: Drive, axis: str, way_m: float, wheel_radius_m: float) -> Travelled:
    target = Motion.from_uv(way_m if axis == "u" else 0.0, way_m if axis == "v" else 0.0)
    seen, sensed = robot.move(drive, target)
    signs = LEG_SIGNS[LEGS[axis]]
    # The wheels' mean rotation along the axis; a mecanum wheel of no slip goes its radius per radian, also sideways.
    rotation = sum(angle * sign for angle, sign in zip(seen.wheels_rad, signs, strict=True)) / len(signs)
    sensing = sensed.u_m if axis == "u" else sensed.v_m
    return Travelled(axis, abs(way_m), abs(rotation) * wheel_radius_m, abs(sensing), seen.distance_m)
