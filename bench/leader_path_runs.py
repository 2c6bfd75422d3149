"""The runs of `leader_paths.py`: one path, surface, predictor and seed each, and what is taken from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from robot_formation import names
from robot_formation.analysis.forecasts import inside_ellipse
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.run_record import FollowerRecord
from robot_formation.components.predictor import PredictorComponent
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.sweep import CONDITIONS
from robot_formation.geometry.se2 import Motion
from robot_formation.koopman.predictors import Ahead, Predictor
from robot_formation.names import Message
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS

TIMESTEPS = 60
PATHS: dict[str, tuple[str, ...]] = {
    "straight": ("straight", "step_m=0.03"),
    "circle12": ("circle", "period=12"),
    "circle20": ("circle", "period=20"),
    "slalom8": ("slalom", "step_m=0.03", "period=8"),
    "slalom12": ("slalom", "step_m=0.03", "period=12"),
    "slalom20": ("slalom", "step_m=0.03", "period=20"),
    "pulse8": ("pulse", "step_m=0.03", "period=8"),
    "pulse12": ("pulse", "step_m=0.03", "period=12"),
    "pulse20": ("pulse", "step_m=0.03", "period=20"),
    "lemniscate": ("lemniscate",),
    "lissajous": ("lissajous",),
    "stadium": ("stadium", "heading=kept"),
    "clothoid": ("clothoid", "step_m=0.03", "heading=kept"),
    "random_walk": ("random_walk",),
    "switch": ("switch",),
}
"""Paths by short name: the path's name, then its parameters."""
WIDTH = "size_m=2.6"
SURFACES = {"bowl": (WIDTH, "curvature_per_m=0.06"), "plane": (WIDTH,), "saddle": (WIDTH, "curvature_per_m=0.06")}
PREDICTORS = ("previous", "previous+close", "trend+close", "edmd+close", "formation")
EDMD = ("predictor.edmd.dictionary=constant identity delay:6", "predictor.edmd.prior=1")
"""Delays give EDMD the phase that a single displacement lacks."""
PHASES = {"5_10": (5, 10), "11_30": (11, 30), "31": (31, 10**9)}
HORIZONS = (1, 3, 5)
HELD = 5
"""Timesteps for which Koopman models have to keep half of the weight."""


class Task(NamedTuple):
    """One run."""

    path: str
    surface: str
    predictor: str
    seed: int


@dataclass(frozen=True)
class Row:
    """What a run yields; None where unavailable."""

    path: str
    surface: str
    predictor: str
    seed: int
    outcome: str
    timesteps: int
    correction_m: float | None
    correction_5_10_m: float | None
    correction_11_30_m: float | None
    correction_31_m: float | None
    formation_error_rmse_m: float | None
    heading_error_rmse_rad: float | None
    prediction_rmse_5_10_m: float | None
    prediction_rmse_11_30_m: float | None
    prediction_rmse_31_m: float | None
    coverage_1: float | None
    coverage_3: float | None
    coverage_5: float | None
    way_rmse_3_m: float | None
    way_rmse_5_m: float | None
    half_weight_timestep: int | None

    @property
    def task(self) -> Task:
        """The run that it is of."""
        return Task(self.path, self.surface, self.predictor, self.seed)


def build(task: Task, settings: Sequence[str]) -> scenarios.Scenario:
    """Make a run's scenario.

    Raises:
        FormationError: on a misspelt or wrong setting KEY=VALUE.
    """
    name, *parameters = PATHS[task.path]
    return scenarios.override(
        scenarios.with_surface(scenarios.load_track("one"), task.surface),
        [
            *CONDITIONS,
            f"world.surface_parameters=[{', '.join(SURFACES[task.surface])}]",
            f"leader.timesteps={TIMESTEPS}",
            f"leader.path={name}",
            f"leader.path_parameters=[{', '.join(parameters)}]",
            f"predictor.name={task.predictor}",
            *(EDMD if task.predictor.startswith("edmd") else ()),
            f"seed={task.seed}",
            *settings,
        ],
    )


class WatchedRun(InProcessRun):
    """A run that asks its predictor for its forecasts whenever it has answered."""

    def __init__(self, scenario: scenarios.Scenario, listen: Callable[[str, Message], None]) -> None:
        self.forecasts: list[list[Ahead]] = []
        self.weights: list[float] = []
        super().__init__(scenario, listen=listen)
        components = (hosted.component for hosted in self._hosted)
        self._predictor = next(c.predictor for c in components if isinstance(c, PredictorComponent))

    def _send(self, namespace: str, topic: names.Topic, message: Message) -> None:
        super()._send(namespace, topic, message)
        if topic == names.PREDICTION:
            self.forecasts.append(self._predictor.ahead(max(HORIZONS)))
            self.weights.append(koopman_weight(self._predictor))


def run_task(task: Task, settings: Sequence[str]) -> Row:
    """Carry out one run."""
    made: list[WatchedRun] = []

    def make_run(scenario: scenarios.Scenario, listen: Callable[[str, Message], None]) -> InProcessRun:
        made.append(WatchedRun(scenario, listen))
        return made[0]

    record = run_in_memory(build(task, settings), make_run)
    analysis = analyse(record)
    follower, totals = analysis.followers[0], analysis.followers[0].totals
    errors = way_errors(record.followers[0], made[0].forecasts)
    quantities: dict[str, Any] = {}
    for phase, (first, last) in PHASES.items():
        found = [t.corrections for t in follower.timesteps if first <= t.t <= last]
        quantities[f"correction_{phase}_m"] = float(sum(c.u_m + c.v_m for c in found)) if found else None
        quantities[f"prediction_rmse_{phase}_m"] = rms([e[0] for t, e in errors[1].items() if first <= t <= last])
    for horizon in HORIZONS:
        inside = [e[1] for t, e in errors[horizon].items() if t > COLLECTION_TIMESTEPS]
        quantities[f"coverage_{horizon}"] = sum(inside) / len(inside) if inside else None
        if horizon > 1:
            quantities[f"way_rmse_{horizon}_m"] = rms([e[0] for t, e in errors[horizon].items() if t > 30])
    return Row(
        *task,
        outcome=analysis.outcome,
        timesteps=totals["timesteps_finished"],
        correction_m=number(totals["correction_m"]),
        formation_error_rmse_m=number(totals["formation_error_rmse_m"]),
        heading_error_rmse_rad=number(totals["heading_error_rmse_rad"]),
        half_weight_timestep=half_weight(made[0].weights),
        **quantities,
    )


def way_errors(
    follower: FollowerRecord, forecasts: Sequence[Sequence[Ahead]]
) -> dict[int, dict[int, tuple[float, bool]]]:
    """For each horizon and last timestep of a way: length of its error [m], and whether the 90 % ellipse holds it."""
    found: dict[int, dict[int, tuple[float, bool]]] = {horizon: {} for horizon in HORIZONS}
    for made, ahead in enumerate(forecasts, 1):  # after timestep `made`
        way = Motion()
        for horizon, forecast in enumerate(ahead, 1):
            t = made + horizon
            if t > len(follower.displacements):
                break
            way = way.then(follower.displacements[t - 1].motion)
            residual = follower.residuals[t - 1].motion
            if horizon not in found or not residual.finite:
                continue
            end = way.then(residual)
            error = np.array([end.u_m, end.v_m]) - forecast.way[:2]
            inside = inside_ellipse(error[None], forecast.way_covariance[None, :2, :2])
            found[horizon][t] = float(np.hypot(*error)), bool(inside[0])
    return found


def koopman_weight(predictor: Predictor) -> float:
    """Weight of the Koopman models of `formation` along v; 0 of other predictors."""
    weights = predictor.diagnostics().weights or {}
    return sum(weight for name, weight in weights.get("v", {}).items() if name not in ("persistence", "trends"))


def half_weight(weights: Sequence[float]) -> int | None:
    """Return the first timestep from which on the weights, one a timestep, are a half or more for `HELD` timesteps."""
    for first in range(len(weights) - HELD + 1):
        if min(weights[first : first + HELD]) >= 0.5:
            return first + 1
    return None


def rms(values: Sequence[float]) -> float | None:
    """Root mean square, None of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def number(value: float | None) -> float | None:
    """Return a float where there is a number: a sum of nothing is an integer."""
    return None if value is None else float(value)
