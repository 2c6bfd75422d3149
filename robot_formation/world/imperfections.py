"""How the real robots differ from their drawings, drawn from the seed."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from robot_formation.world.parameters import ImperfectionParameters


def generator(seed: int, robot: str, source: str) -> np.random.Generator:
    """Random stream of one source of one robot: independent of every other robot and source."""
    key = np.random.SeedSequence([seed, zlib.crc32(robot.encode()), zlib.crc32(source.encode())])
    return np.random.default_rng(key)


@dataclass(frozen=True)
class Imperfections:
    """One robot's fixed deviations; scales are factors about 1, in the order FL, FR, RL, RR and v wheel, u wheel."""

    rolling_radius_scale: tuple[float, ...]
    motor_gain: tuple[float, ...]
    mass_x_m: float
    mass_y_m: float
    encoder_radius_scale: tuple[float, ...]


def draw_imperfections(parameters: ImperfectionParameters, seed: int, robot: str) -> Imperfections:
    """Draw one robot's deviations."""

    def scales(source: str, sigma: float, count: int) -> tuple[float, ...]:
        return tuple(float(1.0 + sigma * value) for value in generator(seed, robot, source).standard_normal(count))

    offset = generator(seed, robot, "mass offset").standard_normal(2) * parameters.mass_offset_m
    return Imperfections(
        scales("rolling radius", parameters.rolling_radius, 4),
        scales("motor gain", parameters.motor_gain, 4),
        float(offset[0]),
        float(offset[1]),
        scales("encoder wheel radius", parameters.encoder_wheel_radius, 2),
    )
