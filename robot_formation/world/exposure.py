"""How the camera chooses exposure time, gain and white balance (MT9M114 image sensor, lens f/2.0).

Each picture has the right values at once: how fast the chip follows a change of light is not modelled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_formation.vision.luminance import LUMINANCE_WEIGHTS
from robot_formation.world.parameters import CameraParameters

Array = NDArray[np.float64]

LINE_S = 35e-6
"""Time to read one of the chip's lines (1190 clocks at 34 MHz), and its shortest exposure."""
READOUT_S = 416 * LINE_S
"""Time from the reading of a picture's first row to that of its last (rolling shutter)."""
MAX_GAIN = 16.0
"""Largest analogue gain; our estimate."""

# Responsivity from the data sheet, V/(lx s); f-number from Pixy2's vendor. Our estimates: the lens lets 90 % of the
# light through, and 1 V is full scale. A Lambertian surface of reflectance 1 under E lux gives E / (4 N^2) on the chip.
_RESPONSIVITY, _TRANSMISSION, _F_NUMBER, _FULL_SCALE_V = 2.24, 0.9, 2.0, 1.0
SIGNAL_PER_LUX_S = _RESPONSIVITY * _TRANSMISSION / (4.0 * _F_NUMBER**2) / _FULL_SCALE_V
"""Signal at gain 1, full scale 1, of a white surface per lux and second of exposure."""

GREY_RATIO = 3.0
"""Largest ratio of a pixel's red or blue to its green, either way, that passes for a grey thing under some lamp."""
_DARKEST = 0.002
"""Least light, full scale 1, that tells a colour."""
_STEPS = 30
_ACCURACY = 0.02
"""Error of the mean level at which the search for an exposure ends."""


class Exposure(NamedTuple):
    """Exposure time in seconds and analogue gain."""

    time_s: float
    gain: float

    @property
    def product_s(self) -> float:
        """Exposure time times gain, which makes the brightness."""
        return self.time_s * self.gain


def lamp_colour(parameters: CameraParameters) -> Array:
    """Light of the lamp in red, green and blue, (3,), about 1: its luminance is what the illuminance says."""
    colour = np.array(parameters.light_colour_rgb, float)
    return np.asarray(colour / (colour @ LUMINANCE_WEIGHTS))


def exposure_of(product_s: float, parameters: CameraParameters) -> Exposure:
    """Split time times gain: time first, up to the frame's period, then gain from 1 to 16.

    Flicker avoidance allows whole periods of the lamp's flicker only, at least one, so that bright light over-exposes.
    """
    time_s = min(max(product_s, LINE_S), 1.0 / parameters.min_frames_per_second)
    if parameters.flicker_avoidance:
        period_s = 0.5 / parameters.mains_hz
        # 1e-9 against rounding: 1/60 s is exactly two periods of 1/120 s.
        time_s = period_s * max(1, math.floor(time_s / period_s + 1e-9))
    return Exposure(time_s, min(max(product_s / time_s, 1.0), MAX_GAIN))


def auto_exposure(levels: NDArray[np.float32], tint: Array, parameters: CameraParameters) -> Exposure:
    """Choose the exposure that brings the picture's mean luma to the camera brightness, or as near as it gets.

    Args:
        levels: 255 light^(1/gamma) of sample pixels, (3, n), as at a signal of 1 for white.
        tint: lamp's colour times white-balance gains, (3,).
        parameters: the camera's.

    The mean over clipped levels is a concave function of the level's scale, so Newton's method climbs to the answer.
    """
    shortest, longest = exposure_of(0.0, parameters), exposure_of(math.inf, parameters)
    signal_per_s = SIGNAL_PER_LUX_S * parameters.illuminance_lux
    tinted = levels * (tint ** (1.0 / parameters.gamma)).astype(np.float32)[:, None]
    mean = _mean_luma(tinted)
    if not mean * signal_per_s:
        return longest
    low, high = ((signal_per_s * end.product_s) ** (1.0 / parameters.gamma) for end in (shortest, longest))
    scale = min(max(parameters.camera_brightness / mean, low), high)
    scaled = np.empty_like(tinted)
    for _ in range(_STEPS):
        np.minimum(np.multiply(scale, tinted, out=scaled), 255.0, out=scaled)
        missing = parameters.camera_brightness - _mean_luma(scaled)
        if missing <= _ACCURACY or scale >= high:
            break
        slope = _mean_luma(np.multiply(tinted, tinted < 255.0 / scale, out=scaled))
        scale = min(scale + missing / slope, high) if slope else high
    return exposure_of(scale**parameters.gamma / signal_per_s, parameters)


def _mean_luma(levels: NDArray[np.float32]) -> float:
    """Mean luma of pixels (3, n)."""
    # What ndarray.mean does, without its checks.
    return float(LUMINANCE_WEIGHTS @ (np.add.reduce(levels, axis=1) / np.float32(levels.shape[1])))


def white_balance(light: NDArray[np.float32]) -> Array:
    """Gains of red, green and blue, (3,), the least of them 1, that make the picture's near-grey pixels grey.

    Grey world over the pixels that could be grey under some lamp, so that a marker in view doesn't shift the hues; 1
    if there is none. The chip's own statistics are not published.

    Args:
        light: linear light of sample pixels, (3, n), full scale 1.
    """
    red, green, blue = light
    grey = green > _DARKEST
    most = GREY_RATIO * green
    for other in (red, blue):
        grey &= other < most
        grey &= green < GREY_RATIO * other
    sums = (light * grey).sum(axis=1, dtype=float)
    return np.asarray(sums.max() / sums) if sums.all() else np.ones(3)
