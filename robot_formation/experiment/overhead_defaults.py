"""Where the overhead camera hangs and what it resolves above plates of other sizes than the paper's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from robot_formation.surface.base import PLATE_SIZE_M
from robot_formation.vision.overhead.lens import OverheadLens
from robot_formation.vision.overhead.tracking_parameters import Calibration, ImperfectCalibration
from robot_formation.world.parameters import OverheadParameters

LARGEST_M = 7.0
"""Largest plate with an overhead camera: 2014 x 2014 px. Beyond, a picture takes more than the rest of the world."""
_PREFIX = "overhead."
_ARRANGED = {*(field.name for field in fields(OverheadLens)), "width_px", "height_px"}
"""Who sets one of these arranges the camera on their own."""


def overhead_camera(size_m: float, own: Mapping[str, object]) -> dict[str, object]:
    """Return the world's parameters of a camera that sees a whole plate as the default camera sees the paper's.

    The camera hangs above the middle. Above a larger plate it hangs higher and has more pixels by the same factor, so
    that a dot is as large in the picture; above a smaller one it hangs where it hangs.

    Args:
        size_m: edge of the square plate, metres.
        own: the world's parameters that are set, flat. Lens, place or picture size among them: nothing follows.
    """
    if size_m == PLATE_SIZE_M or _arranged(own):
        return {}
    if size_m > LARGEST_M:
        return {} if "overhead.enabled" in own else {"overhead.enabled": False}
    default, factor = OverheadParameters(), _factor(size_m)
    pixels = {"width_px": round(factor * default.width_px), "height_px": round(factor * default.height_px)}
    return {_PREFIX + name: value for name, value in (_lens(default, size_m) | pixels).items()}


def overhead_calibrations(size_m: float, own: Mapping[str, object], tracker: Mapping[str, object]) -> dict[str, object]:
    """Return the overhead tracker's parameters that follow: its calibrations are of the same camera.

    Args:
        size_m: edge of the square plate, metres.
        own: the world's parameters that are set, flat.
        tracker: those of the tracker that are set, flat.
    """
    if size_m == PLATE_SIZE_M or size_m > LARGEST_M or _arranged(own):
        return {}
    found = {
        f"{name}.{key}": value
        for name, calibration in (("good", Calibration()), ("imperfect", ImperfectCalibration()))
        for key, value in _lens(calibration, size_m).items()
    }
    return {name: value for name, value in found.items() if name not in tracker}


def too_large_for_overhead(size_m: float, own: Mapping[str, object]) -> bool:
    """Whether the camera is off because of the plate's size, rather than by the scenario's word."""
    return overhead_camera(size_m, own).get("overhead.enabled") is False


def _arranged(own: Mapping[str, object]) -> bool:
    return any(name.removeprefix(_PREFIX) in _ARRANGED for name in own if name.startswith(_PREFIX))


def _factor(size_m: float) -> float:
    return max(1.0, size_m / PLATE_SIZE_M)


def _lens(lens: OverheadLens, size_m: float) -> dict[str, object]:
    """Scale a lens; distortion is of directions, which stay."""
    factor = _factor(size_m)
    return {
        "focal_length_px": factor * lens.focal_length_px,
        # Integers are pixel centres, so that the picture's edge is half a pixel before 0.
        "centre_x_px": factor * (lens.centre_x_px + 0.5) - 0.5,
        "centre_y_px": factor * (lens.centre_y_px + 0.5) - 0.5,
        "x_m": 0.5 * size_m,
        "y_m": 0.5 * size_m,
        "z_m": factor * lens.z_m,
    }
