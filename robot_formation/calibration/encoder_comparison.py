"""Travelled distances by motor encoders, sensing wheels and one-point reference (paper, figure of encoder accuracy)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Travelled:
    """One drive over a preset distance along an axis, as each instrument says, metres, positive either way."""

    axis: str
    preset_m: float
    motor_m: float
    sensing_m: float
    reference_m: float


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation of some drives; 0 for a single one."""

    mean: float
    std: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Summarise values."""
        return cls(float(np.mean(values)), float(np.std(values, ddof=1)) if len(values) > 1 else 0.0)


@dataclass(frozen=True)
class DistanceComparison:
    """All drives over one preset distance; `difference` is sensing minus reference as a fraction of the reference."""

    axis: str
    preset_m: float
    drives: int
    motor_m: Spread
    sensing_m: Spread
    reference_m: Spread
    difference: Spread


def compare_distances(drives: Sequence[Travelled]) -> list[DistanceComparison]:
    """Summarise drives by axis and preset distance, in the order in which these first appear."""
    groups: dict[tuple[str, float], list[Travelled]] = {}
    for drive in drives:
        groups.setdefault((drive.axis, drive.preset_m), []).append(drive)
    return [
        DistanceComparison(
            axis,
            preset,
            len(group),
            Spread.of([d.motor_m for d in group]),
            Spread.of([d.sensing_m for d in group]),
            Spread.of([d.reference_m for d in group]),
            Spread.of([(d.sensing_m - d.reference_m) / d.reference_m for d in group]),
        )
        for (axis, preset), group in groups.items()
    ]
