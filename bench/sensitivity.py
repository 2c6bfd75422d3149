"""When does the paper's method gain? Track two with more slip, other stops, tolerances, camera noise and ground.

The paper reports 78 % less correction distance on track two. Each level changes one condition of the simulation and
leaves all others at their defaults; each run is one level, predictor and seed, in process, camera on demand, fine-tuner
in mode paper. The table OUT/runs.csv grows row by row, and the same command goes on where it was stopped. `table`
prints what it says as Markdown: medians with 95 % bootstrap intervals of the reduction against `previous`, paired over
seeds, and lost runs; `figure` draws the reductions.

    python bench/sensitivity.py run OUT --seeds 0:100 [--levels default,slip4] [--predictors measured] [--jobs 2]
    python bench/sensitivity.py table OUT
    python bench/sensitivity.py figure OUT FILE.png
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.analysis.markdown import interval, table
from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.style import BLACK, BLUE, GREEN, LOST_COLOUR, ORANGE, PINK, styled
from robot_formation.analysis.sweep_summary import BASELINE, summarise
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.sweep import seeds
from robot_formation.errors import FormationError
from robot_formation.experiment import sweep
from robot_formation.json_values import JsonObject
from robot_formation.world.parameters import CameraParameters, ImperfectionParameters, TractionParameters
from run_table import missing, open_table, study_command

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TRACK, SURFACE = "two", "bowl"
PREDICTORS = ("previous", "ewma", "measured", "previous+close", "formation")
PAPER_REDUCTION = 0.78
"""Reduction of the correction distance on track two (paper, section V-B)."""
COLOURS = {"ewma": ORANGE, "measured": PINK, "previous+close": BLUE, "formation": GREEN}
MARKERS = {"ewma": "^", "measured": "D", "previous+close": "s", "formation": "o"}
_TRACTION, _ROBOT, _CAMERA, _ALIGNMENT = (
    TractionParameters(),
    ImperfectionParameters(),
    CameraParameters(),
    AlignmentParameters(),
)


class Level(NamedTuple):
    """One condition that differs from the defaults."""

    group: str
    label: str
    settings: tuple[str, ...] = ()
    surface: str = SURFACE


def _slip(factor: float) -> tuple[str, ...]:
    """Let driving wheels forget their grip over a distance shorter by a factor."""
    return (f"world.traction.relaxation_m={_TRACTION.relaxation_m / factor!r}",)


def _stops(factor: float) -> tuple[str, ...]:
    """Scatter the ends of moves by a factor more."""
    return (
        f"world.imperfections.stop_common_m={factor * _ROBOT.stop_common_m!r}",
        f"world.imperfections.stop_wheel_m={factor * _ROBOT.stop_wheel_m!r}",
    )


def _tolerances(factor: float) -> tuple[str, ...]:
    """Widen what the fine-tuner takes for aligned."""
    return (
        f"fine_tuner.alignment.u_tolerance_m={factor * _ALIGNMENT.u_tolerance_m!r}",
        f"fine_tuner.alignment.v_tolerance_px={factor * _ALIGNMENT.v_tolerance_px!r}",
        f"fine_tuner.alignment.side_tolerance_px={factor * _ALIGNMENT.side_tolerance_px!r}",
    )


def _camera_noise(factor: float) -> tuple[str, ...]:
    """Make the standard deviation of the sensor's noise larger; shot_noise is a variance."""
    return (
        f"world.camera.shot_noise={factor**2 * _CAMERA.shot_noise!r}",
        f"world.camera.read_noise={factor * _CAMERA.read_noise!r}",
    )


LEVELS: dict[str, Level] = {
    "default": Level("default", "bowl, all defaults"),
    "slip0.25": Level("slip", "slip x 0.25", _slip(0.25)),
    "slip2": Level("slip", "slip x 2", _slip(2.0)),
    "slip4": Level("slip", "slip x 4", _slip(4.0)),
    "stops0": Level("stops", "no scatter of stops", _stops(0.0)),
    "stops2": Level("stops", "scatter of stops x 2", _stops(2.0)),
    "stops4": Level("stops", "scatter of stops x 4", _stops(4.0)),
    "tolerance0.5": Level("tolerance", "camera tolerance x 0.5", _tolerances(0.5)),
    "tolerance2": Level("tolerance", "camera tolerance x 2", _tolerances(2.0)),
    "noise2": Level("noise", "camera noise x 2", _camera_noise(2.0)),
    "noise3": Level("noise", "camera noise x 3", _camera_noise(3.0)),
    "plane": Level("surface", "plane", surface="plane"),
    "saddle": Level("surface", "saddle", surface="saddle"),
    "ripple": Level("surface", "ripple", surface="ripple"),
}


class Task(NamedTuple):
    """One run."""

    level: str
    predictor: str
    seed: int


@dataclass(frozen=True)
class Row:
    """What a run yields; None where unavailable. It is what analysis.sweep_summary needs of a run."""

    level: str
    predictor: str
    seed: int
    outcome: str
    correction_m: float | None
    correction_u_m: float | None
    correction_v_m: float | None
    movements_per_timestep: float | None
    formation_error_rmse_m: float | None
    heading_error_rmse_rad: float | None
    prediction_coverage_90: float | None

    @property
    def task(self) -> Task:
        """The run that it is of."""
        return Task(self.level, self.predictor, self.seed)

    @property
    def track(self) -> str:
        """Name of the track."""
        return TRACK

    @property
    def path(self) -> str:
        """Name of the leader's path."""
        return "straight"

    @property
    def surface(self) -> str:
        """The level: runs are compared within a level only."""
        return self.level

    @property
    def lost(self) -> bool:
        """Whether the run didn't come to its end."""
        return self.outcome != "done"


def sweep_task(task: Task) -> sweep.Task:
    """Return the run as a sweep has it."""
    return sweep.Task(TRACK, LEVELS[task.level].surface, task.predictor, task.seed)


def run_task(task: Task) -> Row:
    """Carry out one run."""
    found = sweep.run_task(sweep_task(task), LEVELS[task.level].settings)
    quantities = {name: getattr(found, name) for name in Row.__dataclass_fields__ if name not in Task._fields}
    return Row(*task, **quantities)


def carry_out(args: argparse.Namespace) -> int:
    """Run what is missing in the table."""
    for name, known in (("levels", LEVELS), ("predictors", PREDICTORS)):
        if unknown := [chosen for chosen in getattr(args, name) if chosen not in known]:
            raise FormationError(f"--{name}: no {unknown[0]!r}; there are {', '.join(known)}")
    by_seed = itertools.product(seeds(args.seeds), args.levels, args.predictors)
    chosen = [Task(level, predictor, seed) for seed, level, predictor in by_seed]
    table, tasks = missing(args.out, Row, chosen)
    for level in args.levels:
        sweep.build(sweep_task(Task(level, BASELINE, 0)), LEVELS[level].settings).check()
    for row in with_progress(run_parallel(run_task, ((task,) for task in tasks), args.jobs), len(tasks)):
        table.append([row])
    return 0


def summary(rows: Sequence[Row]) -> dict[str, dict[str, JsonObject]]:
    """Summarise runs by level and predictor, levels in their order."""
    found: dict[str, dict[str, JsonObject]] = {}
    for entry in summarise(rows):
        found.setdefault(entry["surface"], {})[entry["predictor"]] = entry
    return {level: found[level] for level in LEVELS if level in found}


def table_lines(rows: Sequence[Row]) -> list[str]:
    """Return the Markdown table: a line per level, reductions [%] and lost runs."""
    others = [name for name in PREDICTORS if name != BASELINE]
    heads = ["condition", f"`{BASELINE}` (cm)", *(f"`{name}` (%)" for name in others), "lost runs"]
    lines = []
    for level, entries in summary(rows).items():
        lost = ", ".join(f"`{name}` {entry['lost']}" for name, entry in entries.items() if entry["lost"]) or "0"
        baseline = entries[BASELINE]["correction_m"] if BASELINE in entries else None
        reductions = (entries[name]["reduction"] if name in entries else None for name in others)
        cells = [interval(baseline, 100.0), *(interval(value, 100.0, 0) for value in reductions)]
        lines.append([LEVELS[level].label, *cells, lost])
    return table(heads, lines)


def print_table(args: argparse.Namespace) -> int:
    """Print what the table says."""
    rows = list(open_table(args.out, Row).read())
    print("\n".join(table_lines(rows)))
    print(f"\n{len(rows)} runs, {len({row.seed for row in rows})} seeds")
    return 0


LOWEST = -0.75
"""Left end of the figure: what is worse, or lost in the median, stands there as a cross."""


@styled
def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw each level's reductions with their intervals; runs lost in the median lie at the left end."""
    entries = summary(rows)
    others = [name for name in PREDICTORS if name != BASELINE]
    sheet = new_figure(8.4, 0.5 * len(entries) + 1.9)
    axes = sheet.subplots()
    groups = [LEVELS[level].group for level in entries]
    for place, level in enumerate(entries):
        if place and groups[place] != groups[place - 1]:
            axes.axhline(place - 0.5, color="0.8", lw=0.8)
        for number, name in enumerate(others):
            if name in entries[level]:
                at = place + 0.17 * (number - (len(others) - 1) / 2)
                _mark(axes, entries[level][name]["reduction"], at, name, label=name if place == 0 else None)
    axes.axvline(100.0 * PAPER_REDUCTION, color=BLACK, ls="--", lw=1.0, label="the paper's 78 %")
    axes.axvline(0.0, color="0.4", lw=0.8)
    axes.set_xlim(100.0 * LOWEST - 4.0, 104.0)
    axes.set_yticks(range(len(entries)), [LEVELS[level].label for level in entries])
    axes.set_ylim(len(entries) - 0.5, -0.5)
    axes.set_xlabel(
        f"reduction of the correction distance against '{BASELINE}' (%)\n"
        "median over seeds, 95 % interval; right of 0 the predictor gains, left of it it loses"
    )
    axes.grid(axis="x")
    axes.plot([], [], "x", color=LOST_COLOUR, label=f"below {100.0 * LOWEST:.0f} %, or most runs lost")
    handles, _ = axes.get_legend_handles_labels()
    legend_below(sheet, handles, 3)
    count = len({row.seed for row in rows})
    axes.set_title(f"Track two, one condition changed at a time, {count} seeds each")
    save_figure(sheet, path)


def _mark(axes: Axes, value: Mapping[str, float | None] | None, at: float, name: str, label: str | None) -> None:
    """Draw one median with its interval."""
    if value is None:
        return
    middle, low, high = (
        LOWEST if v is None or v < LOWEST else v for v in (value["median"], value["low"], value["high"])
    )
    lost = value["median"] is None or value["median"] < LOWEST
    axes.plot([100.0 * low, 100.0 * high], [at, at], color=COLOURS[name], lw=1.6)
    colour, marker = (LOST_COLOUR, "x") if lost else (COLOURS[name], MARKERS[name])
    axes.plot([100.0 * middle], [at], marker, color=colour, ms=5.5, label=None if lost else label)


def figure(args: argparse.Namespace) -> int:
    """Draw what the table says."""
    draw(list(open_table(args.out, Row).read()), args.file)
    print(args.file)
    return 0


def main() -> int:
    functions = {"run": carry_out, "table": print_table, "figure": figure}
    return study_command(__doc__, functions, "0:100", {"levels": LEVELS, "predictors": PREDICTORS})


if __name__ == "__main__":
    sys.exit(main())
