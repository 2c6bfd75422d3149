"""What a predictor's timestep costs: microseconds per observe and predict, against its peers in the same run.

The peers: `OnlineDMD.update` of the package odmd with the forecast A x, and the least-squares fit of all pairs made
anew in every timestep by numpy's lstsq (its cost grows with the history, of 100 timesteps here). The machine's load
changes all of them alike, so the ratios count: each figure is the median over rounds in which all are timed one after
the other, and each ratio the median of the rounds' own ratios.

Run: python bench/predictor.py [--rounds N] [--timesteps N] [--json]
"""

import argparse
import json
import math
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
from odmd import OnlineDMD

from comparison import Comparison, add_comparisons, as_json
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.koopman.predictors import NAMES, Predictor, PredictorParameters
from robot_formation.parameters import from_mapping

Array = npt.NDArray[np.float64]
Timestep = Callable[[Array, Array, Array], None]

WARM_UP = 3
COMPARED = ("measured", "edmd", "formation")
"""Predictors that fit an operator, as the peers do."""


def history(timesteps: int) -> tuple[Array, Array, Array]:
    """Displacements, residuals and commanded displacements as on the paper's track two, each (timesteps, 2)."""
    rng = np.random.default_rng(0)
    t = np.arange(timesteps)
    displacements = np.stack([0.01 * np.sin(t / 9.0), np.full(timesteps, 0.05)], axis=1)
    displacements += rng.normal(0.0, (0.004, 0.002), (timesteps, 2))
    residuals = rng.normal(0.0, (0.006, 0.003), (timesteps, 2))
    return displacements, residuals, displacements + np.array([0.003, -0.002])


def of_predictor(name: str) -> Timestep:
    """Make the timestep of one of our predictors."""
    predictor = Predictor(from_mapping(PredictorParameters, {**node_defaults("predictor"), "name": name}, where=name))

    def timestep(x: Array, r: Array, c: Array) -> None:
        predictor.observe(np.append(x, 0.0), np.append(r, math.nan), np.append(c, 0.0))  # as in mode paper: no turns
        predictor.predict()

    return timestep


def of_odmd() -> Timestep:
    """Make the timestep of the reference implementation of online DMD."""
    dmd = OnlineDMD(2, 1.0)
    pairs: list[Array] = []

    def timestep(x: Array, r: Array, c: Array) -> None:
        pairs.append(x)
        if len(pairs) == WARM_UP:
            dmd.initialize(np.array(pairs[:-1]).T, np.array(pairs[1:]).T)
        elif len(pairs) > WARM_UP:
            dmd.update(pairs[-2], x)
        dmd.A.dot(x)

    return timestep


def of_lstsq() -> Timestep:
    """Make the timestep that fits K anew to all pairs."""
    rows: list[Array] = []

    def timestep(x: Array, r: Array, c: Array) -> None:
        rows.append(x)
        if len(rows) < WARM_UP:
            return
        data = np.array(rows)
        x @ np.linalg.lstsq(data[:-1], data[1:], rcond=None)[0]

    return timestep


def microseconds(make: Callable[[], Timestep], data: tuple[Array, Array, Array]) -> float:
    """Time one pass over the history after its first timesteps, per timestep."""
    timestep = make()
    rows = list(zip(*data, strict=True))
    for row in rows[:WARM_UP]:
        timestep(*row)
    began = time.perf_counter()
    for row in rows[WARM_UP:]:
        timestep(*row)
    return 1e6 * (time.perf_counter() - began) / (len(rows) - WARM_UP)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=50)
    parser.add_argument("--timesteps", type=int, default=100)
    parser.add_argument("--json", action="store_true")
    add_comparisons(parser)
    args = parser.parse_args()
    data = history(args.timesteps)
    makers: dict[str, Callable[[], Timestep]] = {
        "odmd": of_odmd,
        "lstsq": of_lstsq,
        **{name: partial(of_predictor, name) for name in NAMES},
    }
    times: dict[str, list[float]] = {name: [] for name in makers}
    for _ in range(args.rounds):
        for name, make in makers.items():
            times[name].append(microseconds(make, data))
    found = {
        name: {
            "microseconds": float(np.median(values)),
            "to_odmd": float(np.median(np.divide(values, times["odmd"]))),
            "to_lstsq": float(np.median(np.divide(values, times["lstsq"]))),
        }
        for name, values in times.items()
    }
    if args.comparisons:
        peers = ("odmd", "lstsq")
        print(
            as_json(
                Comparison(
                    f"timestep of `{name}`", row["microseconds"], row["microseconds"] / row[f"to_{peer}"], "us", peer
                )
                for name, row in found.items()
                if name in COMPARED
                for peer in peers
            )
        )
        return
    if args.json:
        print(json.dumps(found, indent=2))
        return
    print(f"{'':20s}{'us per timestep':>16s}{'to odmd':>10s}{'to lstsq':>10s}")
    for name, row in found.items():
        print(f"{name:20s}{row['microseconds']:16.1f}{row['to_odmd']:10.2f}{row['to_lstsq']:10.2f}")


if __name__ == "__main__":
    main()
