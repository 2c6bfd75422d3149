"""Which curves a run's drives use, and whether a calibration was measured on the robots that the run has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.drive.curves import CalibrationError, Curve, calibrated, load_calibration
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.parameters import to_mapping

# What wheel rotations come to depends on these parameters of the world (and on the ground, which the follower has to
# cope with: a calibration is measured on the plane and used anywhere).
_ROBOTS = ("physics_hz", "gravity_m_s2", "chassis.", "wheels.", "motor.", "traction.", "imperfections.")


def robot_facts(drive: DriveParameters, world: WorldNodeParameters) -> dict[str, object]:
    """List by name what makes the robots drive as they do: seed, world parameters, wheel speed."""
    return {
        "seed": world.seed,
        "drive.wheel_speed_rad_s": drive.wheel_speed_rad_s,
        **{f"world.{name}": value for name, value in to_mapping(world).items() if name.startswith(_ROBOTS)},
    }


def check_curves(drive: DriveParameters, world: WorldNodeParameters, robots: Sequence[str]) -> None:
    """Check that every robot has its curves, and that the calibration file was measured on these robots.

    Raises:
        CalibrationError: naming the file and what differs.
    """
    robot_curves(drive, robots)
    path = drive.calibration_file
    found = load_calibration(path).differences(robot_facts(drive, world)) if path else []
    if found:
        raise CalibrationError(
            f"{path}: measured on other robots than this run's: {differ(found)}; calibrate these "
            "with 'formation calibrate motors', or delete the entry from the file to use it all the same"
        )


def robot_curves(drive: DriveParameters, robots: Sequence[str]) -> dict[str, dict[str, Curve]]:
    """List the curves of every robot by axis, as its drive will use them.

    Raises:
        CalibrationError: if the calibration file can't be used for one of them.
    """
    curves = {}
    for robot in robots:
        own = calibrated(drive, robot).calibration
        curves[robot] = {"v": own.v, "u": own.u, "turn": own.turn}
    return curves


def describe_curves(drive: DriveParameters) -> str:
    """Describe in a line of progress which curves are used."""
    path = drive.calibration_file
    if not path:
        return "drive curves: one for all robots, by the parameters drive.calibration.*"
    return f"drive curves: {origin(path, load_calibration(path).measured_with)}"


def origin(path: str, measured_with: Mapping[str, object]) -> str:
    """Describe a calibration file and what it was measured with, as far as it says."""
    said = [f"{name} {measured_with[name]}" for name in ("seed", "surface") if name in measured_with]
    return f"{path}{', measured with ' if said else ''}{', '.join(said)}"


def differ(found: Sequence[str]) -> str:
    """List the first differences, and how many more there are."""
    return ", ".join(found[:3]) + (f" and {len(found) - 3} more" if len(found) > 3 else "")
