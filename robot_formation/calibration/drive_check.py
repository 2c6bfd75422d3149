"""Which curves a scenario's drives use, and whether a calibration was measured on the robots that the scenario has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from robot_formation.drive.curves import CalibrationError, Curve, calibrated, load_calibration
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.parameters import from_mapping

if TYPE_CHECKING:
    from robot_formation.experiment.scenario import Scenario

# What wheel rotations come to depends on these parameters of the world (and on the ground, which the follower has to
# cope with: a calibration is measured on the plane and used anywhere).
_ROBOTS = ("physics_hz", "gravity_m_s2", "chassis.", "wheels.", "motor.", "traction.", "imperfections.")


def robot_facts(scenario: Scenario) -> dict[str, Any]:
    """List by name what makes the scenario's robots drive as they do: seed, world parameters, wheel speed."""
    world = scenario.parameters("world")
    return {
        "seed": scenario.setup.seed,
        "drive.wheel_speed_rad_s": scenario.parameters("drive")["wheel_speed_rad_s"],
        **{f"world.{name}": value for name, value in world.items() if name.startswith(_ROBOTS)},
    }


def check_curves(scenario: Scenario) -> None:
    """Check that every robot has its curves, and that the calibration file was measured on these robots.

    Raises:
        CalibrationError: naming the file and what differs.
    """
    robot_curves(scenario)
    path = scenario.parameters("drive")["calibration_file"]
    differences = load_calibration(path).differences(robot_facts(scenario)) if path else []
    if differences:
        more = f" and {len(differences) - 3} more" if len(differences) > 3 else ""
        raise CalibrationError(
            f"{path}: measured on other robots than this run's: {', '.join(differences[:3])}{more}; calibrate these "
            "with 'formation calibrate motors', or delete the entry from the file to use it all the same"
        )


def robot_curves(scenario: Scenario) -> dict[str, dict[str, Curve]]:
    """List the curves of every robot by axis, as its drive will use them.

    Raises:
        CalibrationError: if the calibration file can't be used for one of them.
    """
    parameters = from_mapping(DriveParameters, scenario.parameters("drive"), where="drive")
    curves = {}
    for robot in scenario.robots:
        own = calibrated(parameters, robot).calibration
        curves[robot] = {"v": own.v, "u": own.u, "turn": own.turn}
    return curves


def describe_curves(scenario: Scenario) -> str:
    """Say in a line of progress which curves are used."""
    path = scenario.parameters("drive")["calibration_file"]
    if not path:
        return "drive curves: one for all robots, by the parameters drive.calibration.*"
    return f"drive curves: {origin(path, load_calibration(path).measured_with)}"


def origin(path: str, measured_with: Mapping[str, Any]) -> str:
    """Name a calibration file and what it was measured with, as far as it says."""
    said = [f"{name} {measured_with[name]}" for name in ("seed", "surface") if name in measured_with]
    return f"{path}{', measured with ' if said else ''}{', '.join(said)}"
