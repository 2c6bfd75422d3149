"""String stability: whether errors and motions grow from one robot of a chain to the next.

A chain is string-stable if what the leader does, or a disturbance, does not grow along it, however long it is (Swaroop
and Hedrick, IEEE Transactions on Automatic Control 41, 1996; in L2 and L-infinity: Ploeg, van de Wouw and Nijmeijer,
IEEE Transactions on Control Systems Technology 22, 2014). With T(z) from the displacements of one robot to those of the
next, L2 string stability is |T| <= 1 at all frequencies. Two robots that move at the same time, the second by the first
one's last displacement with the rest of the place closed, have T = (2z - 1)/z^2 and |T|^2 = 5 - 4 cos(theta) at theta
radians per timestep; one timestep of delay has |T| = 1.

error ratios
    of a follower's formation errors to those of the follower before it: of their root mean squares (L2), and of their
    maxima (L-infinity).
gain
    |X_i / X_(i-1)| of the displacements' spectra, at the frequencies that dominate the leader's motion.

With delayed spacing follower n repeats everything n timesteps late. Its window is shifted by as many, and its errors
count from timestep n + 1 on: before, its neighbour has not moved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.run_record import RunRecord
from robot_formation.json_values import JsonObject
from robot_formation.names import LEADER
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS

Array = NDArray[np.float64]

LEAST_AMPLITUDE_M = 0.004
"""Amplitude from which a frequency of the leader counts: the actuation's noise stays below (1.5 mm per timestep)."""
LEAST_SHARE = 0.3
"""Power from which it counts, as a share of the strongest one's; below lie its side lobes by Hann's window."""
LEAST_WINDOW = 8
"""Timesteps that a spectrum needs at least."""
MOST_TURN_RAD = math.radians(3.0)
"""A leader that turns more in a timestep has no gains: followers' displacements have lever arms then."""
RESAMPLES = 2000


class Interval(NamedTuple):
    """A mean with its 95 % interval."""

    mean: float
    low: float
    high: float

    @property
    def above_one(self) -> bool:
        """Whether the whole interval lies above 1: of error ratios by root mean square, L2 string-unstable."""
        return self.low > 1.0


def spectrum(moves: Array) -> NDArray[np.complex128]:
    """Spectrum of displacements without their mean, by Hann's window.

    Args:
        moves: (timesteps, axes), metres.

    Returns:
        Complex amplitudes at k / timesteps cycles per timestep, (timesteps // 2 + 1, axes), metres.
    """
    count = len(moves)
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.arange(count) / count)
    found = np.fft.rfft(window[:, None] * (moves - moves.mean(axis=0)), axis=0) * 2.0 / window.sum()
    if count % 2 == 0:
        found[-1] /= 2.0  # the one frequency of which there is no mirror image
    return np.asarray(found, dtype=np.complex128)


def dominant(amplitudes_m: Array) -> list[int]:
    """List the numbers of the frequencies that dominate a motion, by the amplitudes of one axis."""
    power = amplitudes_m**2
    counted = (amplitudes_m >= LEAST_AMPLITUDE_M) & (power >= LEAST_SHARE * power[1:].max(initial=0.0))
    return [int(number) for number in np.flatnonzero(counted) if number]


def windows(motions: Sequence[Array], delayed: bool) -> list[Array]:
    """Cut a run's displacements so that each robot's window holds what became of the leader's window.

    Args:
        motions: of each robot, the leader first, (timesteps, axes); they may be of different lengths.
        delayed: whether each robot is a timestep later than the one before.

    Returns:
        Of each robot the same number of timesteps after the collection phase; empty arrays if there are none.
    """
    lags = [number if delayed else 0 for number in range(len(motions))]
    lengths = (len(moves) - COLLECTION_TIMESTEPS - lag for moves, lag in zip(motions, lags, strict=True))
    length = max(0, min(lengths))
    starts = [COLLECTION_TIMESTEPS + lag for lag in lags]
    return [moves[start : start + length] for moves, start in zip(motions, starts, strict=True)]


def error_ratios(errors_m: Sequence[Sequence[float | None]], delayed: bool) -> list[tuple[float | None, float | None]]:
    """Return the ratios of each follower's errors to those of the one before it: (L2, L-infinity), from the second on.

    Args:
        errors_m: of each follower, by timestep; None where unknown.
        delayed: whether the first timesteps of the n-th follower don't count.
    """
    counted = [
        np.array([error for error in errors[number if delayed else 0 :] if error is not None])
        for number, errors in enumerate(errors_m, 1)
    ]
    norms = [
        (float(np.sqrt(np.mean(found**2))), float(np.max(found))) if found.size else (None, None) for found in counted
    ]
    return [(_ratio(own[0], before[0]), _ratio(own[1], before[1])) for before, own in pairwise(norms)]


def _ratio(own: float | None, before: float | None) -> float | None:
    return own / before if own is not None and before else None


def _product(ratios: Sequence[float | None]) -> float | None:
    known = [ratio for ratio in ratios if ratio is not None]
    return math.prod(known) if len(known) == len(ratios) else None


def string_stability(record: RunRecord, errors_m: Sequence[Sequence[float | None]]) -> JsonObject | None:
    """Work out a run's error ratios and gains.

    Args:
        record: the run.
        errors_m: formation errors of each of its followers, by timestep.

    Returns:
        `hops`, of followers 2 to N; `head_to_tail`, follower N to 1; `gains`, from the leader on. None for one
        follower.
    """
    if len(record.followers) < 2:
        return None
    ratios = error_ratios(errors_m, record.delayed)
    names = [follower.name for follower in record.followers]
    hops = [
        {"robot": name, "error_ratio_l2": rms, "error_ratio_linf": largest}
        for name, (rms, largest) in zip(names[1:], ratios, strict=True)
    ]
    return {
        "hops": hops,
        "head_to_tail": {
            "error_ratio_l2": _product([rms for rms, _ in ratios]),
            "error_ratio_linf": _product([largest for _, largest in ratios]),
        },
        "gains": gains(windows(displacements(record), record.delayed)) if keeps_heading(record) else [],
    }


def keeps_heading(record: RunRecord) -> bool:
    """Whether the leader's displacements turn so little that those of its followers are meant to be the same."""
    return all(abs(move.motion.yaw_rad) <= MOST_TURN_RAD for move in record.leader_moved)


def displacements(record: RunRecord) -> list[Array]:
    """Displacements u, v of each robot, the leader first, (timesteps, 2), metres."""
    moves = {LEADER: record.leader_moved, **{found.name: found.displacements for found in record.followers}}
    return [np.array([move.motion.uv_m for move in found]).reshape(-1, 2) for found in moves.values()]


def gains(motions: Sequence[Array]) -> list[JsonObject]:
    """List the gains along a chain at the leader's dominant frequencies.

    Args:
        motions: displacements u, v of each robot, the leader first, in windows of the same length, (timesteps, 2).

    Returns:
        Of each frequency `axis`, `period` in timesteps, the leader's `amplitude_m`, `hops`, from each robot to the
        next, and `head_to_tail`, from the leader to the last one. Empty if the windows are too short.
    """
    count = len(motions[0])
    if count < LEAST_WINDOW:
        return []
    amplitudes = np.abs([spectrum(moves) for moves in motions])
    with np.errstate(divide="ignore", invalid="ignore"):
        hops, whole = amplitudes[1:] / amplitudes[:-1], amplitudes[-1] / amplitudes[0]
    return [
        {
            "axis": axis,
            "period": count / k,
            "amplitude_m": float(amplitudes[0, k, number]),
            "hops": [_finite(gain) for gain in hops[:, k, number]],
            "head_to_tail": _finite(whole[k, number]),
        }
        for number, axis in enumerate(("u", "v"))
        for k in dominant(amplitudes[0, :, number])
    ]


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def geometric_mean(ratios: Sequence[float]) -> Interval:
    """Return the geometric mean of ratios of independent runs, with its 95 % percentile bootstrap interval.

    The resamples come from a fixed stream, so equal data give equal intervals.

    Args:
        ratios: of each run, above 0.

    Raises:
        ValueError: if there are none, or one is not above 0.
    """
    if not ratios or min(ratios) <= 0.0:
        raise ValueError("ratios above 0 are needed")
    logs = np.log(ratios)
    means = np.random.default_rng(0).choice(logs, (RESAMPLES, len(logs))).mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return Interval(math.exp(float(logs.mean())), math.exp(float(low)), math.exp(float(high)))
