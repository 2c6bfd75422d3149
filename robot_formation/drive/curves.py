"""Motor calibrations of single robots: their file, and how a drive gets its own robot's curves from it.

The paper calibrates every robot by itself (section "Movement system calibrations"); `formation calibrate motors`
measures such a file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import yaml

from robot_formation.drive.movement_system import DriveParameters
from robot_formation.errors import FormationError, shown
from robot_formation.json_values import Json, JsonObject
from robot_formation.parameters import suggestion
from robot_formation.system.yaml_files import read_yaml

Curve = tuple[float, ...]

AXES = ("v", "u", "turn")
_MAX_COEFFICIENTS = 8
_CHECKED_POINTS = 50
_DIGITS = 8
_HEAD = """\
# Motor calibration, by 'formation calibrate motors'; drive reads it by its parameter calibration_file.
# Wheel rotation [rad] as a polynomial of the distance [m] (turn: of the angle [rad]): constant term first, odd in the
# sign. 'measured_with' says which robots were measured, and how: a run whose robots differ from it is refused. An
# entry that is deleted isn't compared; robots of one's own need none.
"""


class CalibrationError(FormationError):
    """A calibration can't be measured, read, written or used; the text says why."""


@dataclass(frozen=True)
class MotorCalibration:
    """Curves by robot and axis, and the values by name of what they were measured with."""

    robots: Mapping[str, Mapping[str, Curve]]
    measured_with: Mapping[str, Json] = field(default_factory=dict)

    def differences(self, facts: Mapping[str, Json]) -> list[str]:
        """List the facts that this calibration was measured with other values of; unknown names are no difference."""
        return differences(self.measured_with, facts)


def limits(parameters: DriveParameters) -> dict[str, float]:
    """List the longest calibrated move of each axis: m, m and rad."""
    return {"v": parameters.max_v_m, "u": parameters.max_u_m, "turn": parameters.max_turn_rad}


def calibrated(parameters: DriveParameters, robot: str) -> DriveParameters:
    """Return a drive's parameters with its robot's own curves, if they name a calibration file.

    The file goes before `calibration`, axis by axis; an axis that the file lacks keeps `calibration`'s curve.

    Raises:
        CalibrationError: if the file can't be used, lacks the robot, or a curve doesn't rise over the whole range.
    """
    if not parameters.calibration_file:
        return parameters
    path = parameters.calibration_file
    robots = load_calibration(path).robots
    if robot not in robots:
        raise CalibrationError(
            f"{path}: holds no robot '{robot}', only {', '.join(robots)}; "
            "calibrate the robots of this run with 'formation calibrate motors'"
        )
    for axis, curve in robots[robot].items():
        _check_rising(curve, limits(parameters)[axis], f"{path}: {robot}: {axis}")
    return replace(parameters, calibration=replace(parameters.calibration, **robots[robot]))


def load_calibration(path: str | Path) -> MotorCalibration:
    """Read a calibration file.

    Raises:
        CalibrationError: if it can't be read or a robot, an axis or a curve in it is wrong.
    """
    robots, facts = read_sections(path, "robots", what="motor calibration", verb="formation calibrate motors")
    return MotorCalibration(
        {str(robot): _curves(curves, f"{path}: {robot}") for robot, curves in robots.items()},
        facts,
    )


def read_sections(path: str | Path, section: str, *, what: str, verb: str) -> tuple[Mapping[str, Json], JsonObject]:
    """Read a calibration file's mapping of this name, and what it was measured with.

    Args:
        path: of the file.
        section: name of the mapping that holds the calibration.
        what: kind of calibration, for messages.
        verb: command that measures one, for messages.

    Raises:
        CalibrationError: if it can't be read or holds no such calibration.
    """
    content = read_yaml(path, refuse=CalibrationError, remedy=f"measure one with '{verb}'")
    found = content.get(section) if isinstance(content, Mapping) else None
    if not isinstance(found, Mapping) or not found:
        raise CalibrationError(f"{path}: holds no {what} (a mapping '{section}'); measure one with '{verb}'")
    facts = content.get("measured_with") or {}
    if not isinstance(facts, Mapping):
        raise CalibrationError(f"{path}: 'measured_with' must hold names and values, not {shown(facts)}")
    return found, {str(name): value for name, value in facts.items()}


def differences(measured_with: Mapping[str, Json], facts: Mapping[str, Json]) -> list[str]:
    """List the facts that a calibration was measured with other values of; unknown names are no difference."""
    return [
        f"{name} {measured_with[name]} instead of {value}"
        for name, value in facts.items()
        if name in measured_with and measured_with[name] != value
    ]


def save_calibration(path: str | Path, calibration: MotorCalibration) -> None:
    """Write a calibration as YAML, coefficients to eight digits; an older file there is replaced.

    Raises:
        CalibrationError: if the file can't be written.
    """
    robots = {
        robot: {axis: [float(f"{c:.{_DIGITS}g}") for c in curve] for axis, curve in curves.items()}
        for robot, curves in calibration.robots.items()
    }
    text = _HEAD + yaml.safe_dump({"robots": robots}, sort_keys=False, default_flow_style=None, width=110)
    # One line per entry: people delete some.
    text += yaml.safe_dump({"measured_with": dict(calibration.measured_with)}, sort_keys=False)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise CalibrationError(f"{path}: can't be written ({error.strerror}); choose another folder") from error


def _curves(curves: Json, where: str) -> dict[str, Curve]:
    if not isinstance(curves, Mapping) or not curves:
        raise CalibrationError(f"{where}: needs curves by axis ({', '.join(AXES)}), not {shown(curves)}")
    for axis in curves:
        if axis not in AXES:
            raise CalibrationError(f"{where}: no axis '{axis}'{suggestion(str(axis), AXES)}")
    return {axis: _curve(curve, f"{where}: {axis}") for axis, curve in curves.items()}


def _curve(values: Json, where: str) -> Curve:
    numbers = isinstance(values, Sequence) and all(
        isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) for value in values
    )
    if not numbers or not 2 <= len(values) <= _MAX_COEFFICIENTS:
        raise CalibrationError(
            f"{where}: a curve is a list of 2 to {_MAX_COEFFICIENTS} finite numbers, constant term first, "
            f"not {shown(values)}"
        )
    return tuple(float(value) for value in values)


def _check_rising(curve: Curve, limit: float, where: str) -> None:
    """Refuse a curve that falls somewhere up to the limit, or ends below zero: no distance could be driven by it."""
    amounts = [limit * (step + 1) / _CHECKED_POINTS for step in range(_CHECKED_POINTS)]
    slopes = [sum(power * c * x ** (power - 1) for power, c in enumerate(curve) if power) for x in amounts]
    highest = sum(c * limit**power for power, c in enumerate(curve))
    if limit > 0.0 and (min(slopes) <= 0.0 or highest <= 0.0):
        raise CalibrationError(
            f"{where}: the curve doesn't rise over the whole range up to {limit:g}; measure it again, "
            "or lower the range"
        )
