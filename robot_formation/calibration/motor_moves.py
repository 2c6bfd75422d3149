"""Motor calibration: each robot drives preset wheel rotations, an observer measures, and curves are fitted.

Paper, section "Movement system calibrations": "curve fit the travelled distance measured by observer using one-point
reference for various wheel rotations", follower v and u, leader v. Turns are calibrated beside them, by heading,
since our follower turns too.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from robot_formation.calibration.motor_fit import AxisFit, MeasuredDrive, fit_axis
from robot_formation.calibration.rig import CalibrationRig, RobotOnRig
from robot_formation.drive.curves import MotorCalibration, limits
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.names import LEADER

# More of the short ones, because corrections are short.
FRACTIONS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Preset wheel rotations as fractions of the one that an ideal robot needs for the whole range."""

Fits = dict[str, dict[str, AxisFit]]


def calibrated_axes(robot: str) -> tuple[str, ...]:
    """List the axes that a robot is calibrated along: the leader drives straight ahead only (paper)."""
    return ("v", "turn") if robot == LEADER else ("v", "u", "turn")


def preset_rotations(axis: str, drive: DriveParameters) -> list[float]:
    """List the wheel rotations [rad] that an axis is measured at, by the wheels' geometry without slip or coasting."""
    lever = drive.wheel_lever_m if axis == "turn" else 1.0
    return [fraction * limits(drive)[axis] * lever / drive.wheel_radius_m for fraction in FRACTIONS]


def calibrate_robot(
    robot: RobotOnRig, drive: DriveParameters, repeats: int, say: Callable[[str], None] = lambda text: None
) -> dict[str, AxisFit]:
    """Measure and fit a robot's axes. Every rotation is driven forth and back, so that the robot stays in its place.

    Args:
        robot: on its rig.
        drive: its nominal geometry, range and speed; its curves aren't used.
        repeats: how often each rotation is driven forth and back.
        say: takes a line of progress per axis.

    Raises:
        CalibrationError: if a drive can't be measured or an axis not fitted.
    """
    fits = {}
    for axis in calibrated_axes(robot.robot):
        fit = fit_axis(axis, [d for _ in range(repeats) for d in _forth_and_back(robot, axis, drive)])
        fits[axis] = fit
        unit = "mrad" if axis == "turn" else "mm"
        drives = sum(point.drives for point in fit.points)
        say(f"{robot.robot} {axis}: {drives} drives, residuals {fit.residual_rms * 1e3:.2f} {unit} RMS")
    return fits


def calibrate_motors(
    rig: CalibrationRig,
    robots: list[str],
    drive: DriveParameters,
    repeats: int,
    say: Callable[[str], None] = lambda text: None,
) -> Fits:
    """Measure and fit every robot, each alone on the plate; fits by robot and axis."""
    fits: Fits = {}
    for name in robots:
        with RobotOnRig(rig, name) as robot:
            fits[name] = calibrate_robot(robot, drive, repeats, say)
    return fits


def curves(fits: Fits) -> MotorCalibration:
    """Return the curves alone, as `drive` takes them."""
    return MotorCalibration({robot: {axis: fit.curve for axis, fit in axes.items()} for robot, axes in fits.items()})


def _forth_and_back(robot: RobotOnRig, axis: str, drive: DriveParameters) -> list[MeasuredDrive]:
    drives = []
    for rotation in preset_rotations(axis, drive):
        for signed in (rotation, -rotation):
            seen = robot.turn_wheels(axis, signed, drive.wheel_speed_rad_s)
            travel = seen.turn_rad if axis == "turn" else math.copysign(seen.distance_m, signed)
            drives.append(MeasuredDrive(signed, travel))
    return drives
