"""What a robot's own motor calibration is worth: the mean of repeated 5 cm commands, with it and without.

For each seed's leader and follower: calibrate as `formation calibrate motors` does, then command 5 cm again and again,
all in one sense, with the fitted curves, with the default curves of config/drive.yaml (those of an ideal robot), and
with wheel rotation = distance / wheel radius. Level ground; distances by the one-point reference.

Run: python bench/motor_calibration.py [--seeds N] [--commands N] [--repeats N] [--rolling-radius X]
"""

import argparse
import sys

import numpy as np

from robot_formation.calibration.motor_fit import AxisFit
from robot_formation.calibration.motor_moves import calibrate_robot
from robot_formation.calibration.rig import CalibrationRig, RobotOnRig
from robot_formation.drive.curves import calibrated
from robot_formation.drive.movement_system import CalibrationParameters, Drive, DriveParameters
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import from_mapping
from robot_formation.surface import make_surface
from robot_formation.world.parameters import WorldParameters

STEP_M = 0.05
TOLERANCE_MM = 1.0
FLOOR_M = 40.0  # room for all the commands in one sense
TESTED = (("leader", "v"), ("follower_1", "v"), ("follower_1", "u"))
TARGETS = {"v": Motion(x_m=STEP_M), "u": Motion.from_uv(STEP_M, 0.0)}


def drives(fits: dict[str, AxisFit], defaults: DriveParameters) -> dict[str, DriveParameters]:
    """The drive's parameters by kind of calibration."""
    own = CalibrationParameters(**{axis: fit.curve for axis, fit in fits.items()})
    ideal = (0.0, 1.0 / defaults.wheel_radius_m)
    kinds = {"fitted": own, "default": defaults.calibration, "geometry": CalibrationParameters(v=ideal, u=ideal)}
    return {kind: DriveParameters(calibration=curves) for kind, curves in kinds.items()}


def repeated(robot: RobotOnRig, parameters: DriveParameters, axis: str, commands: int) -> list[float]:
    """Distances driven, mm."""
    drive = Drive(parameters)
    return [robot.move(drive, TARGETS[axis])[0].distance_m * 1e3 for _ in range(commands)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20, help="seeds 0 .. N-1 (default: 20)")
    parser.add_argument("--commands", type=int, default=40, help="5 cm commands per robot and axis (default: 40)")
    parser.add_argument("--repeats", type=int, default=10, help="of the calibration (default: 10)")
    parser.add_argument(
        "--rolling-radius", type=float, default=WorldParameters().imperfections.rolling_radius, help="spread, relative"
    )
    options = parser.parse_args()
    world = from_mapping(
        WorldParameters, {"imperfections.rolling_radius": options.rolling_radius}, where="--rolling-radius"
    )
    defaults = calibrated(from_mapping(DriveParameters, node_defaults("drive"), where="drive"), "")
    floor = make_surface("plane", {"size_m": FLOOR_M})
    driven: dict[tuple[str, str], dict[str, list[list[float]]]] = {(robot, axis): {} for robot, axis in TESTED}
    for seed in range(options.seeds):
        for name in ("leader", "follower_1"):
            with RobotOnRig(CalibrationRig(floor, world, seed), name) as robot:
                kinds = drives(calibrate_robot(robot, defaults, options.repeats), defaults)
                for axis in (axis for tested, axis in TESTED if tested == name):
                    for kind, parameters in kinds.items():
                        distances = repeated(robot, parameters, axis, options.commands)
                        driven[name, axis].setdefault(kind, []).append(distances)
        print(f"seed {seed + 1}/{options.seeds}", file=sys.stderr, flush=True)
    print(
        f"plane, {options.seeds} seeds, rolling radius spread {options.rolling_radius:.1%}, calibration with "
        f"{options.repeats} repeats: mean of {options.commands} commands of {STEP_M * 1e3:g} mm, per robot"
    )
    print("robot       axis  curves      mean of robots   spread   worst robot   within 1 mm   scatter of a drive")
    worst = 0.0
    for (name, axis), by_kind in driven.items():
        for kind, drives_mm in by_kind.items():
            errors = np.mean(drives_mm, axis=1) - STEP_M * 1e3
            scatter = np.sqrt(np.mean(np.var(drives_mm, axis=1, ddof=1)))
            within = np.sum(np.abs(errors) <= TOLERANCE_MM)
            extreme = errors[np.argmax(np.abs(errors))]
            worst = max(worst, abs(extreme)) if kind == "fitted" else worst
            print(
                f"{name:10}  {axis:4}  {kind:8}  {np.mean(errors):+12.2f} mm  {np.std(errors, ddof=1):5.2f} mm"
                f"  {extreme:+8.2f} mm  {within:6} of {len(errors)}  {scatter:12.2f} mm"
            )
    return 0 if worst <= TOLERANCE_MM else 1


if __name__ == "__main__":
    sys.exit(main())
