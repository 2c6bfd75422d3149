"""Whether a camera's calibration was measured on the camera and marker that a run has."""

from __future__ import annotations

from robot_formation.calibration.drive_check import differ, origin
from robot_formation.drive.curves import CalibrationError, differences
from robot_formation.follower.camera_calibration_file import load_vision
from robot_formation.follower.fine_tuning import FineTunerParameters
from robot_formation.parameters import to_mapping
from robot_formation.world.parameters import WorldParameters

# Geometry only: light and colours may change, that is what the camera has to cope with.
_CAMERA = ("width_px", "height_px", "focal_length_px", "centre_x_px", "centre_y_px", "x_m", "y_m", "z_m")
_NAMES = (
    *(f"camera.{name}" for name in (*_CAMERA, "pan_deg", "tilt_deg")),
    "marker.edge_m",
    "marker.top_m",
)


def camera_facts(world: WorldParameters) -> dict[str, object]:
    """List by name the world's parameters that say where the marker appears in the picture."""
    values = to_mapping(world)
    return {f"world.{name}": values[name] for name in _NAMES}


def camera_values(fine_tuner: FineTunerParameters) -> dict[str, float]:
    """List the values `alignment.*` that a calibration file gives the fine-tuner; empty without a file.

    Raises:
        CalibrationError: if the file can't be used.
    """
    path = fine_tuner.calibration_file
    return dict(load_vision(path).alignment) if path else {}


def describe_camera(fine_tuner: FineTunerParameters) -> str:
    """Describe in a line of progress which calibration of the camera is used; empty without a file."""
    path = fine_tuner.calibration_file
    return f"camera calibration: {origin(path, load_vision(path).measured_with)}" if path else ""


def check_camera(fine_tuner: FineTunerParameters, world: WorldParameters) -> None:
    """Check that the fine-tuner's calibration file, if it has one, can be used and is of this world's camera.

    Raises:
        CalibrationError: naming the file and what is wrong or differs.
    """
    path = fine_tuner.calibration_file
    found = differences(load_vision(path).measured_with, camera_facts(world)) if path else []
    if found:
        raise CalibrationError(
            f"{path}: measured with another camera than this run's: {differ(found)}; calibrate this one "
            "with 'formation calibrate vision', or delete the entry from the file to use it all the same"
        )
