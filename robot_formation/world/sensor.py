"""The image sensor: brings linear light to 8-bit pictures by exposure, white balance, gamma, flicker and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.vision.look_up import look_up
from robot_formation.world.camera import Light, RenderedPicture
from robot_formation.world.exposure import (
    READOUT_S,
    SIGNAL_PER_LUX_S,
    Array,
    Exposure,
    auto_exposure,
    lamp_colour,
    white_balance,
)
from robot_formation.world.imperfections import generator
from robot_formation.world.parameters import CameraParameters
from robot_formation.world.scene import FULL

_SAMPLING = 4
"""Every fourth pixel of every fourth row is looked at to choose exposure and white balance."""
_FAINTEST_RIPPLE = 1e-6


@dataclass(frozen=True)
class Development:
    """A picture before noise, and how it was made.

    `levels` and `sigma` are the sensor's own arrays: they hold until it develops the next picture.

    Attributes:
        levels: 8-bit levels as float32, (rows, columns, 3); beyond 255 where the sensor saturates.
        sigma: standard deviation of the noise in 8-bit levels, of the same shape.
        exposure: exposure time and gain.
        balance: white-balance gains of red, green and blue, at least 1.
        ripple: amplitude of the lamp's flicker in the light that a row gathers; 0 for none.
        noise: standard deviation by level and channel, (1, 256, 3).
    """

    levels: NDArray[np.float32]
    sigma: NDArray[np.float32]
    exposure: Exposure
    balance: tuple[float, float, float]
    ripple: float
    noise: NDArray[np.float32]

    @property
    def picture(self) -> RenderedPicture:
        """Picture without noise and flicker, uint8 (rows, columns, 3) RGB."""
        return np.asarray(cv2.convertScaleAbs(self.levels), np.uint8)


class Sensor:
    """Sensor of one robot's camera, switched on when it is made.

    Its noise depends on the seed, the robot and how many frames it has drawn, and on nothing else. Exposure and white
    balance that are not automatic stay what the first picture made them.
    """

    def __init__(self, parameters: CameraParameters, seed: int, robot: str) -> None:
        self.parameters = p = parameters
        self._stream = generator(seed, robot, "camera")
        self._shape = (p.height_px, p.width_px, 3)
        self._size = p.height_px * p.width_px * 3
        self._pool = self._stream.standard_normal(3 * self._size, dtype=np.float32)
        # Large arrays are made once: new memory costs more than what is done in it.
        self._levels = np.empty(self._shape, np.float32)
        self._rounded = np.empty(self._shape, np.uint8)
        self._sigma = np.empty(self._shape, np.float32)
        self._scratch = np.empty(self._shape, np.float32)
        self._table = _level_table(p.gamma)
        self._lamp = lamp_colour(p)
        self._row_times = READOUT_S / p.height_px * np.arange(p.height_px)
        self._kept_exposure: Exposure | None = None
        self._kept_balance: tuple[float, float, float] | None = None

    def develop(self, light: Light) -> Development:
        """Expose a picture by `Camera.light`; the first one sets what is not automatic."""
        p = self.parameters
        sampled = light[_SAMPLING // 2 :: _SAMPLING, _SAMPLING // 2 :: _SAMPLING]
        samples: Light = np.ascontiguousarray(sampled.transpose(2, 0, 1)).reshape(3, -1)
        balance = self._balance(samples)
        tint = self._lamp * balance
        exposure = self._exposure(samples, tint)
        # The curve is a power, so that a factor on the light is a factor on the levels.
        white = SIGNAL_PER_LUX_S * p.illuminance_lux * exposure.product_s * tint
        look_up(self._table, light, out=self._levels)
        rows = self._levels.reshape(p.height_px, -1)
        rows *= np.tile((white ** (1.0 / p.gamma)).astype(np.float32), p.width_px)
        noise = _noise_table(p, exposure.gain, np.array(balance))
        self._find_sigma(self._levels, noise, self._sigma)
        return Development(self._levels, self._sigma, exposure, balance, self._ripple(exposure), noise)

    def expose(self, development: Development, time_s: float) -> RenderedPicture:
        """One frame with noise and flicker, uint8 (rows, columns, 3) RGB.

        Args:
            development: from `develop`, as often as the scene stands still.
            time_s: time at which the first row is read; the lamp is brightest at 0.
        """
        levels, sigma = development.levels, development.sigma
        if development.ripple:
            middles = time_s - 0.5 * development.exposure.time_s + self._row_times
            gathered = 1.0 + development.ripple * np.cos(4.0 * math.pi * self.parameters.mains_hz * middles)
            bands = gathered ** (1.0 / self.parameters.gamma)
            levels = levels * bands.astype(np.float32)[:, None, None]
            sigma = self._scratch
            self._find_sigma(levels, development.noise, sigma)
        offset = int(self._stream.integers(0, 2 * self._size))
        drawn = self._pool[offset : offset + self._size].reshape(self._shape)
        cv2.multiply(drawn, sigma, dst=self._scratch)
        return np.asarray(cv2.add(levels, self._scratch, dtype=cv2.CV_8U), np.uint8)

    def _find_sigma(self, levels: NDArray[np.float32], noise: NDArray[np.float32], sigma: NDArray[np.float32]) -> None:
        """Look up the standard deviation of every pixel and channel, in 8-bit levels."""
        cv2.convertScaleAbs(levels, dst=self._rounded)
        cv2.LUT(self._rounded, noise, dst=sigma)

    def _balance(self, samples: Light) -> tuple[float, float, float]:
        """Gains in force for a picture of these samples (3, n)."""
        p = self.parameters
        if self._kept_balance is not None:
            return self._kept_balance
        red, green, blue = 1.0, 1.0, 1.0
        if p.auto_white_balance or p.auto_white_balance_on_power_up:
            red, green, blue = white_balance(samples * (self._lamp / FULL).astype(np.float32)[:, None]).tolist()
        if not p.auto_white_balance:
            self._kept_balance = (red, green, blue)
        return red, green, blue

    def _exposure(self, samples: Light, tint: Array) -> Exposure:
        """Exposure in force for a picture of these samples (3, n)."""
        if self._kept_exposure is not None:
            return self._kept_exposure
        exposure = auto_exposure(look_up(self._table, samples), tint, self.parameters)
        if not self.parameters.auto_exposure_correction:
            self._kept_exposure = exposure
        return exposure

    def _ripple(self, exposure: Exposure) -> float:
        """Amplitude of 1 + m cos(4 pi f t), averaged over the exposure time; f is the mains' frequency."""
        p = self.parameters
        if p.flicker_avoidance:
            return 0.0
        ripple = p.mains_flicker * float(np.sinc(2.0 * p.mains_hz * exposure.time_s))
        return ripple if abs(ripple) > _FAINTEST_RIPPLE else 0.0


@lru_cache(maxsize=8)
def _level_table(gamma: float) -> NDArray[np.float32]:
    """8-bit level (not rounded) of every 16-bit linear light, shape (65536,)."""
    return (255.0 * (np.arange(65536) / FULL) ** (1.0 / gamma)).astype(np.float32)


@lru_cache(maxsize=8)
def _light_of_levels(gamma: float) -> Array:
    """Linear light, full scale 1, of every 8-bit level, shape (256, 1)."""
    return np.asarray((np.arange(256) / 255.0) ** gamma)[:, None]


def _noise_table(parameters: CameraParameters, gain: float, balance: Array) -> NDArray[np.float32]:
    """Noise in 8-bit levels by level and channel, shape (1, 256, 3).

    Variance of the signal, full scale 1, is shot * gain * signal + (read * gain)^2; white balance amplifies it, and the
    curve's slope maps it.
    """
    p = parameters
    light = _light_of_levels(p.gamma)
    sigma = np.sqrt(balance * p.shot_noise * gain * light + (balance * p.read_noise * gain) ** 2)
    # In the dark the curve is steeper than the noise is small: its slope is taken one standard deviation up.
    slope = 255.0 / p.gamma * np.maximum(np.maximum(light, sigma), 1e-9) ** (1.0 / p.gamma - 1.0)
    return np.asarray(slope * sigma, np.float32)[None]
