"""Predictors along synthetic leader paths, in closed loop: how far a follower in paper mode has to correct.

A follower obeys its predictor; its camera sees what is left with the noise of the paper mode (6 mm along u, 1 mm along
v), and corrects what is beyond the tolerances (1.5 cm along u, 6 mm along v). The leader's steps have noise of 1 mm and
1.5 mm, the follower's moves a constant bias and 1 mm of noise. There is no slip, no tilt and no detector: whole runs in
the simulated world decide. Every path takes a random phase from the seed; the first step is known beforehand.

Printed are, per path, mean correction distance [cm] of timesteps 4 to the end and RMSE [mm] of the prediction move
along u and v.

Run: python bench/forecasts.py [--predictors NAME,...] [--seeds A:B] [--timesteps N] [--aggregation NAME]
"""

from __future__ import annotations

import argparse
import math

import numpy as np
import numpy.typing as npt

from robot_formation.koopman.predictors import Predictor, PredictorParameters
from robot_formation.koopman.predictors.parameters import ClosingParameters, FormationParameters

Array = npt.NDArray[np.float64]

TOLERANCE_M = np.array([0.015, 0.006])
CAMERA_M = np.array([0.006, 0.001])
LEADER_M = np.array([0.001, 0.0015])
ACTUATION_M = 0.001
COLLECTION = 3

PATHS = (
    ("circle", 10.0), ("circle", 17.0), ("circle", 26.0), ("slalom", 9.0), ("slalom", 14.0), ("slalom", 17.0),
    ("pulse", 9.0), ("pulse", 14.0), ("pulse", 17.0), ("lemniscate", 32.0), ("lemniscate", 44.0), ("lissajous", 56.0),
    ("lissajous", 70.0), ("straight", 0.0), ("stadium", 0.0), ("random_walk", 0.0), ("switch", 13.0),
)  # fmt: skip


def steps_of(name: str, period: float, seed: int, count: int) -> Array:
    """Steps (u, v) of a path, (count, 2), heading kept."""
    rng = np.random.default_rng([seed, 99])
    phase = 2.0 * math.pi * rng.random()
    numbers = np.arange(count + 1)
    angles = 2.0 * math.pi * numbers / period + phase if period else 0.0 * numbers
    if name in ("lemniscate", "lissajous"):
        x, y = (
            (0.3 * np.sin(angles), 0.15 * np.sin(2.0 * angles))
            if name == "lemniscate"
            else (0.35 * np.sin(2.0 * angles), 0.35 * np.sin(3.0 * angles + 0.5))
        )
        return np.stack([-np.diff(y), np.diff(x)], axis=1)
    angles = angles[:-1]
    if name == "slalom":
        return np.stack([0.03 * np.cos(angles), np.full(count, 0.03)], axis=1)
    if name == "pulse":
        return np.stack([np.zeros(count), 0.03 + 0.02 * np.cos(angles)], axis=1)
    if name == "switch":
        found = np.tile([0.0, 0.05], (count, 1))
        found[20:] = steps_of("slalom", period, seed, count)[20:]
        found[40:] = steps_of("circle", period, seed, count)[40:]
        return found
    if name == "random_walk":
        angles = np.cumsum(rng.normal(0.0, 0.25, count))
    elif name == "stadium":
        turning = (np.arange(count) + rng.integers(0, 39)) % 39 >= 20
        angles = np.cumsum(np.where(turning, math.pi / 19.0, 0.0))
    return 0.05 * np.stack([np.sin(angles), np.cos(angles)], axis=1)


def run(predictor: Predictor, steps: Array, seed: int) -> tuple[float, Array]:
    """Follow the steps; return the correction distance [m] and errors of prediction moves (n, 2) [m]."""
    rng = np.random.default_rng([seed, 7])
    bias, r, command = rng.normal(0.0, (0.002, 0.003)), rng.normal(0.0, (0.004, 0.001)), steps[0]
    corrected, errors = 0.0, np.empty_like(steps)
    moves = steps + rng.normal(0.0, 1.0, steps.shape) * LEADER_M
    for t, step in enumerate(moves):
        ideal = r + step
        moved = command + bias + rng.normal(0.0, ACTUATION_M, 2)
        total, r, errors[t] = moved, ideal - moved, ideal - moved
        for _ in range(3):
            seen = r + rng.normal(0.0, 1.0, 2) * CAMERA_M
            move = np.where(np.abs(seen) > TOLERANCE_M, seen, 0.0)
            if not move.any():
                break
            corrected += float(np.abs(move).sum()) if t >= COLLECTION else 0.0
            move = move + rng.normal(0.0, ACTUATION_M, 2) * (move != 0.0)
            total, r = total + move, r - move
        seen = r + rng.normal(0.0, 1.0, 2) * CAMERA_M
        predictor.observe(*(np.append(value, 0.0) for value in (total, seen, command + total - moved)))
        command = predictor.predict().command[:2] if t + 1 >= COLLECTION else total
    return corrected, errors[COLLECTION:]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--predictors", default="previous+close,trend+close,measured+close,formation")
    parser.add_argument("--seeds", default="1000:1003", help="first and one past the last (default 1000:1003)")
    parser.add_argument("--timesteps", type=int, default=60)
    parser.add_argument("--aggregation", choices=("exponential", "ml_poly"), default="exponential")
    args = parser.parse_args()
    names = args.predictors.split(",")
    first, last = map(int, args.seeds.split(":"))
    print(f"{'cm (u/v mm)':20s}" + "".join(f"{name:>22s}" for name in names))
    for path, period in PATHS:
        cells = []
        for name in names:
            found = []
            for seed in range(first, last):
                steps = steps_of(path, period, seed, args.timesteps)
                closing = ClosingParameters(step_u_m=float(steps[0, 0]), step_v_m=float(steps[0, 1]))
                formation = FormationParameters(aggregation=args.aggregation)
                made = Predictor(PredictorParameters(name=name, closing=closing, formation=formation))
                found.append(run(made, steps, seed))
            u, v = 1e3 * np.sqrt(np.mean([np.mean(errors**2, axis=0) for _, errors in found], axis=0))
            cells.append(f"{100.0 * np.mean([corrected for corrected, _ in found]):8.1f} ({u:4.1f}/{v:4.1f})")
        print(f"{path:12s}{period or '':<8}" + "".join(f"{cell:>22s}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
