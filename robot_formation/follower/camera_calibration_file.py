"""Calibrations of a follower's camera: their file, and how the fine-tuner gets its values from it.

The paper calibrates the camera at places around the beacon neighbour (section "Visual fine-tuning process
calibrations"); `formation calibrate vision` measures such a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import yaml

from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.drive.curves import CalibrationError, read_sections
from robot_formation.follower.fine_tuning import FineTunerParameters
from robot_formation.json_values import Json, JsonObject
from robot_formation.parameters import ParameterError, from_mapping, suggestion, to_mapping

T = TypeVar("T", bound=FineTunerParameters)

NAMES = ("target_x_px", "slope_px_per_m", "side_px_m", "side_bias_px", "distance_m")
"""The parameters `alignment.*` that a camera's calibration holds; tolerances and steps are the user's choice."""

_DIGITS = 6
_HEAD = """\
# Camera calibration, by 'formation calibrate vision'; fine_tuner reads it by its parameter calibration_file, and takes
# these values instead of its parameters alignment.*. 'measured_with' says which camera and marker were measured: a run
# whose camera differs from it is refused. An entry that is deleted isn't compared.
"""


@dataclass(frozen=True)
class VisionCalibration:
    """Values of `alignment.*` by name, and the values by name of what they were measured with."""

    alignment: Mapping[str, float]
    measured_with: Mapping[str, Json] = field(default_factory=dict)


def calibrated(parameters: T) -> T:
    """Return a fine-tuner's parameters with the camera's calibration, if they name a calibration file.

    The file goes before `alignment`, value by value; a value that the file lacks keeps `alignment`'s.

    Raises:
        CalibrationError: if the file can't be used.
    """
    if not parameters.calibration_file:
        return parameters
    values: JsonObject = dict(load_vision(parameters.calibration_file).alignment)
    return replace(parameters, alignment=replace(parameters.alignment, **values))


def load_vision(path: str | Path) -> VisionCalibration:
    """Read a calibration file.

    Raises:
        CalibrationError: if it can't be read, or a name or a value in it is wrong.
    """
    values, facts = read_sections(path, "alignment", what="camera calibration", verb="formation calibrate vision")
    for name in values:
        if name not in NAMES:
            raise CalibrationError(f"{path}: alignment: no value '{name}'{suggestion(str(name), NAMES)}")
    try:
        checked = to_mapping(from_mapping(AlignmentParameters, values, where=f"{path}: alignment"))
    except ParameterError as error:
        raise CalibrationError(str(error)) from error
    return VisionCalibration({name: checked[name] for name in values}, facts)


def save_vision(path: str | Path, calibration: VisionCalibration) -> None:
    """Write a calibration as YAML, values to six digits; an older file there is replaced.

    Raises:
        CalibrationError: if the file can't be written.
    """
    values = {name: float(f"{value:.{_DIGITS}g}") for name, value in calibration.alignment.items()}
    content = {"alignment": values, "measured_with": dict(calibration.measured_with)}
    try:
        Path(path).write_text(_HEAD + yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise CalibrationError(f"{path}: can't be written ({error.strerror}); choose another folder") from error
