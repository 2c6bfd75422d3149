"""Parameters of the overhead tracker: its calibrations, and how it follows dots."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.parameters import Choice, parameter
from robot_formation.vision.overhead.lens import OverheadLens


@dataclass(frozen=True)
class Calibration(OverheadLens):
    """What a calibration holds: lens and place of the camera, and what is taken for the ground.

    The defaults are the true values of the simulated camera: the good calibration.
    """

    knows_surface: bool = parameter(True, "true: robots stand on the surface; false: on a level plane")
    plane_m: float = parameter(0.0, "height of that plane", unit="m", low=-10.0, high=10.0)
    stance_m: float = parameter(
        0.145,
        "distance of the wheels from base_link: how far a robot's origin hangs above a hollow",
        unit="m",
        low=0.0,
        high=2.0,
    )


@dataclass(frozen=True)
class ImperfectCalibration(Calibration):
    """A calibration as the paper's must have been: distortion only partly known, and the plate taken for level."""

    centre_x_px: float = parameter(
        255.5, "column of the optical axis: the picture's middle", unit="px", low=-1e4, high=1e4
    )
    centre_y_px: float = parameter(
        255.5, "row of the optical axis: the picture's middle", unit="px", low=-1e4, high=1e4
    )
    k1: float = parameter(-0.09, "radial distortion, second order", low=-1.0, high=1.0)
    k2: float = parameter(0.0, "radial distortion, fourth order", low=-1.0, high=1.0)
    p1: float = parameter(0.0, "tangential distortion along rows", low=-0.1, high=0.1)
    p2: float = parameter(0.0, "tangential distortion along columns", low=-0.1, high=0.1)
    knows_surface: bool = parameter(False, "true: robots stand on the surface; false: on a level plane")
    plane_m: float = parameter(0.1, "height of that plane", unit="m", low=-10.0, high=10.0)


class UsedCalibration(Choice):
    """Which of the tracker's two calibrations is used."""

    GOOD = "good"
    IMPERFECT = "imperfect"


@dataclass(frozen=True)
class OverheadTrackingParameters:
    """The tracker's calibrations, and how it follows dots."""

    calibration: UsedCalibration = parameter(UsedCalibration.GOOD, "which of the two calibrations is used")
    dot_height_m: float = parameter(0.216, "height of the dot above base_link", unit="m", low=0.0, high=2.0)
    dot_radius_m: float = parameter(0.015, "radius of the dot", unit="m", low=0.001, high=0.2)
    threshold: int = parameter(150, "8-bit level between the dots and everything else", low=1, high=254)
    gate_m: float = parameter(
        0.25,
        "farthest place from the expected one at which a dot is still the same robot's",
        unit="m",
        low=0.01,
        high=10.0,
    )
    velocity_gain: float = parameter(0.4, "weight of the last displacement in the expected one", low=0.0, high=1.0)
    good: Calibration = Calibration()
    imperfect: ImperfectCalibration = ImperfectCalibration()

    def chosen(self) -> Calibration:
        """Return the calibration in use."""
        return self.good if self.calibration is UsedCalibration.GOOD else self.imperfect
