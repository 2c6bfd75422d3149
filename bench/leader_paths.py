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
import sys

import numpy as np

from leader_path_runs import PATHS, PHASES, PREDICTORS, SURFACES, TIMESTEPS, Row, Task, build, run_task
from leader_path_tables import COMPARED, OWN, cell, details, grouped, lost_runs, print_table, rank, ratio_lines
from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.sweep import seeds
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS
from run_table import add_settings, missing, open_table, study_command

MARKS = {
    "previous": ("0.6", "x"),
    "previous+close": ("#0072b2", "s"),
    "trend+close": ("#e69f00", "^"),
    "edmd+close": ("#cc79a7", "D"),
    "formation": ("#009e73", "o"),
}
"""Colour (for the colour-blind: Okabe and Ito) and marker of each predictor in the figure."""


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
    functions = {"run": carry_out, "report": report, "figure": figure}
    choices = {"paths": PATHS, "surfaces": SURFACES, "predictors": PREDICTORS}
    return study_command(__doc__, functions, "0:20", choices, add_settings)


if __name__ == "__main__":
    sys.exit(main())
