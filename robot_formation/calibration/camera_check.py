"""Which camera and marker a scenario has, and whether a camera's calibration was measured on them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robot_formation.calibration.drive_check import origin
from robot_formation.drive.curves import CalibrationError, differences
from robot_formation.follower.camera_calibration_file import load_vision

if TYPE_CHECKING:
    from robot_formation.experiment.scenario import Scenario

# Geometry only: light and colours may change, that is what the camera has to cope with.
_CAMERA = ("width_px", "height_px", "focal_length_px", "centre_x_px", "centre_y_px", "x_m", "y_m", "z_m")
_NAMES = (
    *(f"camera.{name}" for name in (*_CAMERA, "pan_deg", "tilt_deg")),
    "marker.edge_m",
    "marker.top_m",
)


def camera_facts(scenario: Scenario) -> dict[str, Any]:
    """List by name the world's parameters that say where the marker appears in the picture."""
    world = scenario.parameters("world")
    return {f"world.{name}": world[name] for name in _NAMES}


def camera_values(scenario: Scenario) -> dict[str, float]:
    """List the values `alignment.*` that the scenario's calibration file gives the fine-tuner; empty without a file.

    Raises:
        CalibrationError: if the file can't be used.
    """
    path = scenario.parameters("fine_tuner")["calibration_file"]
    return dict(load_vision(path).alignment) if path else {}


def describe_camera(scenario: Scenario) -> str:
    """Say in a line of progress which calibration of the camera is used; empty without a file."""
    path = scenario.parameters("fine_tuner")["calibration_file"]
    if not path:
        return ""
    return f"camera calibration: {origin(path, load_vision(path).measured_with)}"


def check_camera(scenario: Scenario) -> None:
    """Check that the fine-tuner's calibration file, if it has one, can be used and is of this scenario's camera.

    Raises:
        CalibrationError: naming the file and what is wrong or differs.
    """
    path = scenario.parameters("fine_tuner")["calibration_file"]
    if not path:
        return
    found = differences(load_vision(path).measured_with, camera_facts(scenario))
    if found:
        more = f" and {len(found) - 3} more" if len(found) > 3 else ""
        raise CalibrationError(
            f"{path}: measured with another camera than this run's: {', '.join(found[:3])}{more}; calibrate this one "
            "with 'formation calibrate vision', or delete the entry from the file to use it all the same"
        )
