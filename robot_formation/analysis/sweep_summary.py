"""What a sweep's runs say together: medians with bootstrap intervals, and paired comparisons over seeds.

Reduction: median over seeds of the paired 1 - C / C_previous, with C a run's correction distance. Ratio: median over
seeds of the paired C / C_other. A run that didn't come to its end ranks worst and is never left out. Intervals are 95 %
percentile bootstrap intervals over seeds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis import markdown
from robot_formation.json_values import JsonObject

BASELINE = "previous"
RESAMPLES = 2000
MEDIANS = (
    "correction_m",
    "correction_u_m",
    "correction_v_m",
    "movements_per_timestep",
    "formation_error_rmse_m",
    "heading_error_rmse_rad",
)


class RunRow(Protocol):
    """What the summary needs of a run."""

    @property
    def track(self) -> str:
        """Name of the track."""

    @property
    def path(self) -> str:
        """Name of the leader's path."""

    @property
    def surface(self) -> str:
        """Name of the surface."""

    @property
    def predictor(self) -> str:
        """Name of the predictor."""

    @property
    def seed(self) -> int:
        """Seed of the run."""

    @property
    def lost(self) -> bool:
        """Whether the run didn't come to its end."""

    @property
    def correction_m(self) -> float | None:
        """Correction distance, metres."""

    @property
    def prediction_coverage_90(self) -> float | None:
        """Share of timesteps inside the prediction's 90 % ellipse."""


def summarise(rows: Sequence[RunRow]) -> list[JsonObject]:
    """Summarise runs by track, path, surface and predictor, in order of appearance; None where nothing is known."""
    groups: dict[tuple[str, str, str, str], dict[int, RunRow]] = {}
    for row in rows:
        groups.setdefault((row.track, row.path, row.surface, row.predictor), {})[row.seed] = row
    found = []
    for (track, path, surface, predictor), runs in groups.items():
        entry: JsonObject = {"track": track, "path": path, "surface": surface, "predictor": predictor}
        entry["runs"] = len(runs)
        entry["lost"] = sum(row.lost for row in runs.values())
        entry["lost_rate"] = entry["lost"] / len(runs)
        for name in MEDIANS:
            entry[name] = median_with_interval(_known(runs.values(), name))
        coverages = [row.prediction_coverage_90 for row in runs.values() if row.prediction_coverage_90 is not None]
        entry["prediction_coverage_90"] = float(np.mean(coverages)) if coverages else None
        baseline = groups.get((track, path, surface, BASELINE))
        entry["reduction"] = median_with_interval(_reductions(runs, baseline)) if baseline else None
        entry["ratio_to"] = {
            other: median_with_interval(_ratios(runs, groups[track, path, surface, other]))
            for other in dict.fromkeys(key[3] for key in groups)
            if other != predictor and (track, path, surface, other) in groups
        }
        found.append(entry)
    return found


def median_with_interval(values: Sequence[float]) -> dict[str, float | None] | None:
    """Return median and 95 % bootstrap interval; infinite ones are None, that is, worse than any number.

    The resamples come from a fixed stream, so equal data give equal intervals.
    """
    if not values:
        return None
    data = np.sort(np.asarray(values, dtype=float))
    draws = np.random.default_rng(0).integers(0, len(data), size=(RESAMPLES, len(data)))
    medians = np.sort(_median(data[draws]))
    outside = round(0.025 * RESAMPLES) - 1  # as many resamples beyond either end
    low, high = medians[outside], medians[RESAMPLES - 1 - outside]
    return {"median": _finite(_median(data[None, :])[0]), "low": _finite(low), "high": _finite(high)}


def _median(data: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median along the last axis; between an infinite and a finite value it is infinite, never NaN."""
    ordered = np.sort(data, axis=-1)
    middle = ordered.shape[-1] // 2
    if ordered.shape[-1] % 2:
        return np.asarray(ordered[..., middle])
    return np.asarray(0.5 * ordered[..., middle - 1] + 0.5 * ordered[..., middle])


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _known(runs: Iterable[RunRow], name: str) -> list[float]:
    """Collect a quantity where it is known; that of a lost run, which is of fewer timesteps, is worse than any."""
    values = [math.inf if row.lost else getattr(row, name) for row in runs]
    return [value for value in values if value is not None]


def _reductions(runs: dict[int, RunRow], baseline: dict[int, RunRow]) -> list[float]:
    return [1.0 - ratio for ratio in _ratios(runs, baseline)]


def _ratios(runs: dict[int, RunRow], others: dict[int, RunRow]) -> list[float]:
    """Pair C / C_other of the seeds that both have; a lost run is infinitely worse, against a lost one it is 0."""
    pairs = [(_rank(runs[seed]), _rank(others[seed])) for seed in runs if seed in others]
    return [_ratio(own, other) for own, other in pairs if own is not None and other is not None]


def _rank(run: RunRow) -> float | None:
    """Correction distance in metres; infinite for a lost run, None for one that ended before any was counted."""
    return math.inf if run.lost else run.correction_m


def _ratio(own_m: float, other_m: float) -> float:
    if math.isinf(own_m):
        return math.inf
    if other_m == 0.0:
        return 1.0 if own_m == 0.0 else math.inf
    return own_m / other_m


def table(summary: Sequence[JsonObject]) -> str:
    """Print the summary as a Markdown table: cm, with intervals in brackets; paths only if not all are straight."""
    named: tuple[str, ...] = ("track", "path", "surface", "predictor", "runs", "lost")
    if all(entry["path"] == "straight" for entry in summary):
        named = tuple(name for name in named if name != "path")
    heads = (*named, "correction [cm]", "reduction [%]", "RMSE [cm]", "moves per step", "in 90 % ellipse [%]")
    rows = []
    for entry in summary:
        coverage = entry["prediction_coverage_90"]
        row = [
            *(str(entry[name]) for name in named),
            markdown.interval(entry["correction_m"], 100.0),
            markdown.interval(entry["reduction"], 100.0, 0),
            markdown.interval(entry["formation_error_rmse_m"], 100.0, 2),
            markdown.interval(entry["movements_per_timestep"], 1.0, 2),
            "-" if coverage is None else f"{100.0 * coverage:.0f}",
        ]
        rows.append(row)
    return "\n".join(markdown.table(heads, rows))
