"""Predictors on leaders of many paths: what is left for the camera to correct, per path and per phase of the run.

Each run is one path, surface, predictor and seed: 60 timesteps in process, camera on demand, fine-tuner in mode paper
unless --set says otherwise. The leader keeps its heading, since mode paper follows no turns; the plate is 2.6 m wide,
so that no path leaves it. The table OUT/runs.csv grows row by row, and the same command goes on where it was stopped.
`report` prints what the table says: medians over seeds, and paired ratios with 95 % bootstrap intervals. `figure` draws
the medians.

Phases are timesteps 5 to 10, 11 to 30, and 31 to the end. Errors of prediction: ideal way over h timesteps minus
forecast. Coverage: share of them in the forecast's 90 % ellipse. Half of the weight: the first timestep from which on
the Koopman models of `formation` have half of the weight along v for five timesteps.

    python bench/leader_paths.py run OUT --seeds 0:20 [--paths circle12,slalom8] [--surfaces bowl]
    python bench/leader_paths.py report OUT
    python bench/leader_paths.py figure OUT FILE.png
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robot_formation import names
from robot_formation.analysis.forecasts import inside_ellipse
from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.run_record import FollowerRecord
from robot_formation.analysis.sweep_summary import median_with_interval
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.sweep import seeds
from robot_formation.components.predictor import PredictorComponent
from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.sweep import CONDITIONS
from robot_formation.geometry.se2 import Motion
from robot_formation.koopman.predictors import Ahead, Predictor
from robot_formation.names import Message
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS
from run_table import missing, open_table

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
OWN = "formation"
COMPARED = ("previous+close", "formation")
HELD = 5
"""Timesteps for which Koopman models have to keep half of the weight."""
MARKS = {
    "previous": ("0.6", "x"),
    "previous+close": ("#0072b2", "s"),
    "trend+close": ("#e69f00", "^"),
    "edmd+close": ("#cc79a7", "D"),
    "formation": ("#009e73", "o"),
}
"""Colour (for the colour-blind: Okabe and Ito) and marker of each predictor in the figure."""


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


def carry_out(args: argparse.Namespace) -> int:
    """Run what is missing in the table."""
    chosen = [
        Task(path, surface, predictor, seed)
        for seed in seeds(args.seeds)
        for path, surface, predictor in itertools.product(args.paths, args.surfaces, args.predictors)
    ]
    table, tasks = missing(args.out, Row, chosen)
    for task in {(task.path, task.surface, task.seed): task for task in tasks}.values():
        build(task, args.set).check()
    rows = run_parallel(run_task, ((task, args.set) for task in tasks), args.jobs)
    for row in with_progress(rows, len(tasks)):
        table.append([row])
    return 0


Runs = dict[tuple[str, str], dict[str, dict[int, Row]]]
"""Rows by path and surface, then predictor, then seed."""


def grouped(rows: Sequence[Row]) -> Runs:
    """Sort rows."""
    found: Runs = {}
    for row in rows:
        found.setdefault((row.path, row.surface), {}).setdefault(row.predictor, {})[row.seed] = row
    return found


def rank(row: Row) -> float:
    """Correction distance [m], infinite for a run that didn't come to its end."""
    return math.inf if row.outcome != "done" or row.correction_m is None else row.correction_m


def ratios(own: Mapping[int, Row], other: Mapping[int, Row]) -> list[float]:
    """Paired ratios of correction distances, over the seeds that both have; a lost run is infinitely worse."""
    found = []
    for seed in own.keys() & other.keys():
        a, b = rank(own[seed]), rank(other[seed])
        if math.isinf(a) and math.isinf(b):
            continue  # nothing to compare
        found.append(math.inf if math.isinf(a) else a / b if b > 0.0 else 1.0 if a == 0.0 else math.inf)
    return found


def cell(values: Sequence[float], scale: float = 1.0, digits: int = 1) -> str:
    """Median with its 95 % bootstrap interval."""
    found = median_with_interval(values)
    if found is None:
        return "-"
    middle, low, high = (
        "lost" if value is None else f"{scale * value:.{digits}f}"
        for value in (found["median"], found["low"], found["high"])
    )
    return f"{middle} ({low}..{high})"


def known(runs: Mapping[int, Row], name: str) -> list[float]:
    """Collect a column where it is known."""
    values = [getattr(row, name) for row in runs.values()]
    return [value for value in values if value is not None]


def print_table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print("\n| " + " | ".join(head) + " |\n" + "|---" * len(head) + "|")
    for line in lines:
        print("| " + " | ".join(line) + " |")


def report(args: argparse.Namespace) -> int:
    """Print what the table says."""
    runs = grouped(list(open_table(args.out, Row).read()))
    predictors = list(dict.fromkeys(name for found in runs.values() for name in found))
    print("Correction distance from timestep 4 on [cm]: median over seeds, 95 % interval of the median")
    print_table(
        ["path", "surface", "seeds", "lost", *predictors],
        [
            [
                path,
                surface,
                str(max(map(len, found.values()))),
                ", ".join(f"{name} {lost}" for name in found if (lost := lost_runs(found[name]))) or "0",
                *(cell([rank(row) for row in found.get(name, {}).values()], 100.0) for name in predictors),
            ]
            for (path, surface), found in runs.items()
        ],
    )
    others = [name for name in predictors if name != OWN]
    print(f"\nRatio of the correction distance of `{OWN}` to that of another predictor, paired over seeds")
    print_table(["path", "surface", *others, "best of them"], list(ratio_lines(runs, others)))
    print(
        f"\nBy phase: correction distance [cm] of {' / '.join(COMPARED)}; formation error RMSE [cm]; of `{OWN}`: share"
    )
    print("of ideal ways in the 90 % ellipse of 1, 3 and 5 timesteps [%], timestep of half of the weight")
    print_table(
        ["path", "surface", *(phase.replace("_", " to ") for phase in PHASES), "RMSE", "coverage", "half weight"],
        [[path, surface, *details(found)] for (path, surface), found in runs.items()],
    )
    return 0


def ratio_lines(runs: Runs, others: Sequence[str]) -> Iterator[list[str]]:
    """Yield the lines of the table of ratios: path and surface, and then every path over all of its surfaces."""
    of_path: dict[str, list[list[list[float]]]] = {}
    for (path, surface), found in runs.items():
        best = min(others, key=lambda name: middle_rank(found.get(name, {})))
        compared = [ratios(found.get(OWN, {}), found.get(name, {})) for name in [*others, best]]
        of_path.setdefault(path, []).append(compared)
        yield [path, surface, *(cell(values, 1.0, 2) for values in compared)]
    for path, surfaces in of_path.items():
        if len(surfaces) > 1:
            columns = zip(*surfaces, strict=True)
            yield [path, "all", *(cell(list(itertools.chain(*column)), 1.0, 2) for column in columns)]


def middle_rank(runs: Mapping[int, Row]) -> float:
    """Median correction distance [m] of a predictor's runs, infinite without any."""
    return float(np.median([rank(row) for row in runs.values()])) if runs else math.inf


def details(found: Mapping[str, Mapping[int, Row]]) -> Iterator[str]:
    """Yield the cells of the table by phase."""
    for phase in PHASES:
        yield " / ".join(middle(known(found.get(name, {}), f"correction_{phase}_m"), 100.0) for name in COMPARED)
    yield " / ".join(middle(known(found.get(name, {}), "formation_error_rmse_m"), 100.0, 2) for name in COMPARED)
    own = found.get(OWN, {})
    shares = [known(own, f"coverage_{horizon}") for horizon in HORIZONS]
    yield " / ".join(f"{100.0 * float(np.mean(share)):.0f}" if share else "-" for share in shares)
    reached = known(own, "half_weight_timestep")
    yield f"{float(np.median(reached)):.0f} ({len(reached)} of {len(own)})" if reached else f"0 of {len(own)}"


def middle(values: Sequence[float], scale: float, digits: int = 1) -> str:
    """Median of values, or a dash."""
    return f"{scale * float(np.median(values)):.{digits}f}" if values else "-"


def lost_runs(runs: Mapping[int, Row]) -> int:
    """Count the runs that didn't come to their end."""
    return sum(row.outcome != "done" for row in runs.values())


def figure(args: argparse.Namespace) -> int:
    """Draw the medians of the correction distance per timestep, one panel per surface."""
    runs = grouped(list(open_table(args.out, Row).read()))
    surfaces = list(dict.fromkeys(surface for _, surface in runs))
    paths = [name for name in PATHS if any(path == name for path, _ in runs)]
    sheet = new_figure(4.2 * len(surfaces) + 2.0, 0.36 * len(paths) + 1.8)
    panels = np.atleast_1d(sheet.subplots(1, len(surfaces), sharey=True))
    handles: dict[str, object] = {}
    for panel, surface in zip(panels, surfaces, strict=True):
        for number_, name in enumerate(MARKS):
            places, values = [], []
            for row, path in enumerate(paths):
                found = runs.get((path, surface), {}).get(name, {})
                if found:
                    places.append(row + 0.14 * (number_ - (len(MARKS) - 1) / 2))
                    values.append([100.0 * rank(r) / (TIMESTEPS - COLLECTION_TIMESTEPS) for r in found.values()])
            if not values:
                continue
            values = [[value for value in v if math.isfinite(value)] or [math.nan] for v in values]  # without lost runs
            medians = [float(np.median(v)) for v in values]
            spread = np.array([np.abs(np.quantile(v, (0.25, 0.75)) - np.median(v)) for v in values])
            colour, marker = MARKS[name]
            handles[name] = panel.errorbar(
                medians,
                places,
                xerr=spread.T if len(spread) else None,
                fmt=marker,
                color=colour,
                ms=5,
                lw=1,
                label=name,
            )
        panel.set_title(surface)
        panel.set_xlabel("correction distance per timestep (cm)")
        panel.set_xlim(left=0.0)
        panel.grid(axis="x", color="0.85", lw=0.6)
        panel.set_axisbelow(True)
    panels[0].set_yticks(range(len(paths)), paths)
    panels[0].invert_yaxis()
    legend_below(sheet, list(handles.values()), min(2 * len(surfaces), len(handles)))
    save_figure(sheet, args.file)
    print(args.file)
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    for name, function in (("run", carry_out), ("report", report), ("figure", figure)):
        verb = verbs.add_parser(name, help=function.__doc__)
        verb.add_argument("out", type=Path, help="folder of the table")
        verb.set_defaults(function=function)
        if name == "run":
            verb.add_argument("--seeds", default="0:20")
            verb.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
            verb.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
            for option, every in (("paths", PATHS), ("surfaces", SURFACES), ("predictors", PREDICTORS)):
                verb.add_argument(f"--{option}", type=lambda text: text.split(","), default=list(every))
        if name == "figure":
            verb.add_argument("file", type=Path)
    args = parser.parse_args()
    try:
        return int(args.function(args))
    except FormationError as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
