"""Parameters of the search for ArUco tags."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.parameters import parameter


@dataclass(frozen=True)
class TagParameters:
    """What a user tunes on the search for tags; descriptions name OpenCV's parameters where they have one."""

    enlargement: int = parameter(
        2, "Pictures are enlarged so many times before the search: small tags need it", low=1, high=4
    )
    min_perimeter_px: float = parameter(
        32.0, "Shortest outline of a dark square that is looked at", unit="px", low=8.0, high=1000.0
    )
    window_px: int = parameter(
        11,
        "adaptiveThreshWinSizeMin and Max: window that tells dark from light; one is enough, and others cost time",
        unit="enlarged px",
        low=3,
        high=101,
    )
    threshold_constant: float = parameter(
        10.0,
        "adaptiveThreshConstant: how much darker than its surroundings dark is",
        unit="levels",
        low=0.0,
        high=100.0,
    )
    polygon_accuracy: float = parameter(
        0.03,
        "polygonalApproxAccuracyRate: how straight the square's sides must be, by its outline",
        low=0.005,
        high=0.2,
    )
    error_correction: float = parameter(
        0.6, "errorCorrectionRate: share of the wrong bits that the dictionary could correct", low=0.0, high=1.0
    )
