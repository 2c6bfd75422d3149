"""Run-time bounds and the colour table: which colour differences belong to which signature (Pixy2 behaviour)."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_formation.vision.pixy2.parameters import SIGNATURES, DetectorParameters
from robot_formation.vision.pixy2.signatures import Signature
from robot_formation.vision.pixy2.teaching import SCALE_BITS

STRIDE = 64
"""Bins of each difference, r-g or b-g: bin i, from -32 to 31, holds the differences from 8 i to 8 i + 7."""
_CODE_GAIN = np.float32(1.5)


def is_code(signature: Signature, mode: int) -> bool:
    """Whether a signature makes colour codes rather than boxes in this colour code mode."""
    return mode == 2 or (mode != 0 and signature.type == 1)


def run_time_bounds(signature: Signature, gain: float, *, code: bool = False) -> tuple[int, int, int, int]:
    """Chroma bounds u_min, u_max, v_min, v_max in force, all exclusive, in 1/32768.

    Args:
        signature: the taught bounds.
        gain: "Signature range", which stretches the taught interval about its middle.
        code: whether the signature makes colour codes; its range then counts 1.5 times.
    """
    factor = np.float32(gain) * _CODE_GAIN if code else np.float32(gain)

    def stretched(bound: int, mean: int) -> int:
        return int(np.float32(mean) + np.float32(bound - mean) * factor)

    return (
        stretched(signature.u_min, signature.u_mean),
        stretched(signature.u_max, signature.u_mean),
        stretched(signature.v_min, signature.v_mean),
        stretched(signature.v_max, signature.v_mean),
    )


@dataclass(frozen=True)
class ColorTable:
    """All that the scanner asks per cell.

    Attributes:
        labels: signature number or 0 by 64 * iu + iv, shape (4096,), uint8; iu is the bin of r-g, iv that of b-g.
            Numbers below zero count from the end.
        low: lower bounds of (r-g)/(r+g+b) and (b-g)/(r+g+b) by signature number, shape (2, 8). A quotient above its
            bound is one whose u (or v), truncated to whole 1/32768, is above the run-time bound.
        high: upper bounds, alike.
        min_sum: smallest r+g+b.
    """

    labels: npt.NDArray[np.uint8]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    min_sum: int

    @classmethod
    def of(cls, signatures: Iterable[Signature], parameters: DetectorParameters) -> ColorTable:
        """Return the table of signatures in any order; those asked for last are kept."""
        return _kept(tuple(signatures), parameters)

    @classmethod
    def built(cls, signatures: Iterable[Signature], parameters: DetectorParameters) -> ColorTable:
        """Build the table."""
        min_sum = max(1, int(np.float32(765) * np.float32(parameters.min_brightness)))
        bounds = {}
        low, high = np.zeros((2, 2, SIGNATURES + 1))
        for signature in signatures:
            if signature.u_min == signature.u_max == 0:
                continue
            code = is_code(signature, parameters.color_code_mode)
            gain = parameters.range_of(signature.sig)
            u_min, u_max, v_min, v_max = bounds[signature.sig] = run_time_bounds(signature, gain, code=code)
            low[:, signature.sig] = [_above(bound) for bound in (u_min, v_min)]
            high[:, signature.sig] = [-_above(-bound) for bound in (u_max, v_max)]
        labels = _labels(bounds, min_sum)
        for array in (labels, low, high):
            array.setflags(write=False)
        return cls(labels, low, high, min_sum)


@functools.lru_cache(maxsize=8)
def _kept(signatures: tuple[Signature, ...], parameters: DetectorParameters) -> ColorTable:
    return ColorTable.built(signatures, parameters)


def _above(bound: int) -> float:
    """The chroma, as a fraction, above which a chroma truncated toward zero exceeds an integer bound in 1/32768.

    From 0 on it must reach the next integer. Sums of two pixels are at most 1530, so no quotient lies within 1/4096
    below an integer.
    """
    return (bound + 1 - 1 / 4096 if bound >= 0 else bound) / (1 << SCALE_BITS)


def _labels(bounds: Mapping[int, tuple[int, int, int, int]], min_sum: int) -> npt.NDArray[np.uint8]:
    """Label the bins by what the camera finds at every fourth level of r, g and b; of several signatures the lowest."""
    none = SIGNATURES + 1
    labels = np.full(STRIDE * STRIDE, none, np.uint8)
    g, b = np.meshgrid(*[np.arange(0, 256, 4, dtype=np.int32)] * 2, indexing="ij")
    for r in range(0, 256, 4):  # all at once would take 12 MB
        total = r + g + b
        divisor = np.maximum(total, 1)
        u = ((r - g << SCALE_BITS) / divisor).astype(np.int32)
        v = ((b - g << SCALE_BITS) / divisor).astype(np.int32)
        bins = (r - g >> 3) * STRIDE + (b - g >> 3)
        for number, (u_min, u_max, v_min, v_max) in bounds.items():
            inside = (u > u_min) & (u < u_max) & (v > v_min) & (v < v_max) & (total >= min_sum)
            found = bins[inside]
            labels[found] = np.minimum(labels[found], number)
    labels[labels == none] = 0
    return labels
