"""Bank models for `FilterBank`: levels with trends, and Koopman oscillators.

On a periodic orbit the eigenvalues of the Koopman operator are exp(i j theta), theta = 2 pi / period: a lattice on the
unit circle with one unknown. An oscillator of a given period and number of harmonics is a linear model with exactly
these eigenvalues, and a bank of periods finds the period by likelihood. Amplitudes and phases are the filter's states.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from robot_formation.koopman.predictors.filter_bank import BankModel, conditioned
from robot_formation.koopman.predictors.parameters import ClosingParameters, OscillatorParameters


class PriorKnowledge:
    """What is known before timestep 1, per axis (u, v, turn), from the parameters of the closing.

    Attributes:
        start: (3,) standard deviation of the residual.
        step, step_sigma: (3,) leader-induced displacement and its standard deviation.
        scale: (3,) by how much lengths are multiplied to be lengths or turns of an axis.
        camera: (3,) variance of the camera's residual.
    """

    def __init__(self, p: ClosingParameters) -> None:
        self.start = np.array([p.start_u_m, p.start_v_m, p.start_turn_rad])
        self.step = np.array([p.step_u_m, p.step_v_m, p.step_turn_rad])
        self.step_sigma = np.array([p.step_sigma_u_m, p.step_sigma_v_m, p.step_sigma_turn_rad])
        self.scale = np.array([1.0, 1.0, p.rad_per_m])
        self.camera = np.array([p.residual_u_m, p.residual_v_m, p.residual_turn_rad]) ** 2


def trends(known: PriorKnowledge, axis: int, settings: Iterable[tuple[float, float, float, float, float]]) -> BankModel:
    """Make filters (r, level, trend) of an axis from (noise, level, trend, damping, first trend) of each."""
    rows = list(settings)
    scale = known.scale[axis]
    count = len(rows)
    onward, noise = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    covariances = np.zeros((count, 3, 3))
    for number, (_, level, trend, damping, first) in enumerate(rows):
        onward[number] = [[1.0, 0.0, 0.0], [0.0, 1.0, damping], [0.0, 0.0, damping]]
        noise[number] = np.diag([0.0, scale * level, scale * trend]) ** 2
        covariances[number] = np.diag([known.start[axis], known.step_sigma[axis], scale * first]) ** 2
    return BankModel(
        axes=np.full((count, 1), axis),
        onward=onward,
        readout=np.tile([0.0, 1.0, 0.0], (count, 1, 1)),
        noise=noise,
        jitter=np.array([[(scale * row[0]) ** 2] for row in rows]),
        means=np.tile([0.0, known.step[axis], 0.0], (count, 1)),
        covariances=covariances,
        losses=np.zeros(count),
    )


def oscillators(
    known: PriorKnowledge, axis: int, p: OscillatorParameters, periods: NDArray[np.float64], harmonics: int
) -> BankModel:
    """Make filters (r, level, c_1, s_1, ...) of an axis: a level and oscillations of these periods and overtones."""
    size, count, scale = 2 + 2 * harmonics, len(periods), known.scale[axis]
    amplitudes = [p.amplitude_m / j for j in range(1, harmonics + 1) for _ in range(2)]
    prior = np.diag([known.start[axis], scale * p.level_start_m, *(scale * np.array(amplitudes))]) ** 2
    readout = np.zeros(size)
    readout[1] = 1.0
    readout[2::2] = 1.0
    mean, cov = conditioned(np.zeros(size), prior, readout, known.step[axis], known.step_sigma[axis])
    onward = np.tile(np.eye(size), (count, 1, 1))
    for j in range(1, harmonics + 1):
        onward[:, 2 * j : 2 * j + 2, 2 * j : 2 * j + 2] = rotations(2.0 * math.pi * j / periods)
    changes = np.array([0.0, p.level_m, *([p.change_m] * (2 * harmonics))]) * scale
    return BankModel(
        axes=np.full((count, 1), axis),
        onward=onward,
        readout=np.tile(readout, (count, 1, 1)),
        noise=np.tile(np.diag(changes) ** 2, (count, 1, 1)),
        jitter=np.full((count, 1), (scale * p.noise_m) ** 2),
        means=np.tile(mean, (count, 1)),
        covariances=np.tile(cov, (count, 1, 1)),
        losses=np.zeros(count),
    )


def turning(known: PriorKnowledge, p: OscillatorParameters, periods: NDArray[np.float64], *, level: bool) -> BankModel:
    """Make filters of u and v together: a displacement whose direction turns evenly, beside a constant one or none.

    The period's sign is the direction of rotation. State (r_u, r_v, z_u, z_v, level_u, level_v); eigenvalues
    exp(+-i theta), and 1 of the level.
    """
    size, count = (6 if level else 4), len(periods)
    sigmas = [known.start[0], known.start[1], p.amplitude_m, p.amplitude_m, *([p.level_start_m] * (size - 4))]
    prior = np.diag(sigmas) ** 2
    readout = np.zeros((2, size))
    readout[0, 2] = readout[1, 3] = 1.0
    if level:
        readout[0, 4] = readout[1, 5] = 1.0
    mean, cov = np.zeros(size), prior
    for axis in range(2):
        mean, cov = conditioned(mean, cov, readout[axis], known.step[axis], known.step_sigma[axis])
    onward = np.tile(np.eye(size), (count, 1, 1))
    onward[:, 2:4, 2:4] = rotations(2.0 * math.pi / periods)
    changes = [0.0, 0.0, p.change_m, p.change_m, *([p.level_m] * (size - 4))]
    return BankModel(
        axes=np.tile([0, 1], (count, 1)),
        onward=onward,
        readout=np.tile(readout, (count, 1, 1)),
        noise=np.tile(np.diag(changes) ** 2, (count, 1, 1)),
        jitter=np.full((count, 2), p.noise_m**2),
        means=np.tile(mean, (count, 1)),
        covariances=np.tile(cov, (count, 1, 1)),
        losses=np.zeros(count),
    )


def periods_of(p: OscillatorParameters) -> NDArray[np.float64]:
    """Return the bank's periods (count,): evenly spaced in the square root of frequency.

    What tells two frequencies apart is the phase between them after some timesteps, whatever the period; but long
    periods have to be told apart by fewer periods. Evenly spaced periods waste filters on long ones, evenly spaced
    frequencies on short ones.
    """
    roots = np.linspace(p.longest**-0.5, p.shortest**-0.5, p.count)
    return np.asarray(roots**-2.0)


def rotations(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices (n, 2, 2) of rotations by angles (n,)."""
    cosines, sines = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([cosines, -sines], -1), np.stack([sines, cosines], -1)], -2)


def joined(models: Sequence[BankModel]) -> BankModel:
    """Put filters of the same size into one bank."""
    names = BankModel.__dataclass_fields__
    return BankModel(**{name: np.concatenate([getattr(model, name) for model in models]) for name in names})
