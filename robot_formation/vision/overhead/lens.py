"""Lens and place of the overhead camera: what the simulated camera has, and what a calibration of it holds."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.parameters import parameter


@dataclass(frozen=True)
class OverheadLens:
    """A camera that looks straight down, its columns along the world's x; OpenCV's model of distortion."""

    focal_length_px: float = parameter(560.0, "focal length in x and y", unit="px", low=10.0, high=1e5)
    centre_x_px: float = parameter(257.3, "column of the optical axis", unit="px", low=-1e4, high=1e4)
    centre_y_px: float = parameter(254.1, "row of the optical axis", unit="px", low=-1e4, high=1e4)
    k1: float = parameter(-0.12, "radial distortion, second order", low=-1.0, high=1.0)
    k2: float = parameter(0.02, "radial distortion, fourth order", low=-1.0, high=1.0)
    p1: float = parameter(0.0006, "tangential distortion along rows", low=-0.1, high=0.1)
    p2: float = parameter(-0.0004, "tangential distortion along columns", low=-0.1, high=0.1)
    k3: float = parameter(0.0, "radial distortion, sixth order", low=-1.0, high=1.0)
    x_m: float = parameter(0.89, "lens in the world", unit="m", low=-100.0, high=100.0)
    y_m: float = parameter(0.89, "lens in the world", unit="m", low=-100.0, high=100.0)
    z_m: float = parameter(2.5, "lens in the world", unit="m", low=0.3, high=100.0)
