"""Sweeps: many runs of a scenario over predictors, seeds, surfaces and paths."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import plugins
from robot_formation.analysis.sweep_summary import summarise
from robot_formation.api.inputs import path_of, whole_number
from robot_formation.api.scenarios import Scenario, definition_of
from robot_formation.batch.progress_line import with_progress
from robot_formation.errors import FormationError, shown
from robot_formation.experiment import sweep as sweeps
from robot_formation.experiment import sweep_runs
from robot_formation.experiment.one_process import check_one_process
from robot_formation.experiment.sweep_results import seeds_text, sweep_report, sweep_text, write_results
from robot_formation.extras import require
from robot_formation.json_values import JsonObject

if TYPE_CHECKING:
    import pandas as pd

Row = sweeps.Row


@dataclass(frozen=True, repr=False)
class Sweep:
    """Many runs and what they say together. `sweep` and `load_sweep` make one.

    Attributes:
        plan: what was to be run; not part of the documented interface.
        rows: a row per run: what was run, its outcome, and the first follower's totals, None where unknown.
        folder: where the table of runs is kept; None: nowhere.
    """

    plan: sweeps.Plan
    rows: tuple[Row, ...]
    folder: Path | None = None

    @cached_property
    def _summary(self) -> list[JsonObject]:
        return summarise(self.rows)

    def summary(self) -> str:
        """Return the table that `formation sweep` prints: medians with 95 % bootstrap intervals, in Markdown."""
        return sweep_text(self.plan, self._summary)

    def report(self) -> JsonObject:
        """Return what `formation sweep --json` prints, as a dictionary."""
        return sweep_report(self.plan, self._summary, self.folder)

    def to_pandas(self) -> pd.DataFrame:
        """Return a table with a row per run; lengths in metres, angles in radians.

        Raises:
            FormationError: pandas is not installed.
        """
        from robot_formation.api.tables import table

        return table([asdict(row) for row in self.rows], list(Row.__dataclass_fields__))

    def save_picture(self, path: str | os.PathLike[str]) -> Path:
        """Draw every run's correction distance, a panel for each track, path and surface; an older file is replaced.

        Args:
            path: of a .png, .svg or .pdf file.

        Raises:
            FormationError: the file can't be written, or isn't one of these.
        """
        from robot_formation.analysis.sweep_figure import draw_sweep

        return draw_sweep(self.rows, path_of("path", path))

    def __repr__(self) -> str:
        """Return the essentials in a line."""
        plan = self.plan
        said = [f"{len(self.rows)} runs of {', '.join(plan.tracks)}", f"predictors {', '.join(plan.predictors)}"]
        said += [f"surfaces {', '.join(plan.surfaces)}", f"paths {', '.join(plan.paths)}", seeds_text(plan.seeds)]
        lost = sum(row.lost for row in self.rows)
        return f"<Sweep {'; '.join(said)}; {lost} lost>"


def sweep(
    scenario: Scenario,
    *,
    predictors: Sequence[str] | None = None,
    seeds: Iterable[int] = range(20),
    surfaces: Sequence[str] | None = None,
    paths: Sequence[str] | None = None,
    jobs: int = 1,
    out: str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Sweep:
    """Run every combination of predictors, seeds, surfaces and paths, each in one process.

    Each run is the same as `run(scenario.changed(...))`. `formation sweep` makes its scenarios otherwise: of preset
    tracks, with the paper's rules of alignment and the camera on demand.

    Args:
        scenario: what all runs have in common.
        predictors: names of `predictors()`, `module:Class`, or "ideal" and "ideal+close", the noise floor; None: the
            scenario's own, as for the next two.
        seeds: of the runs; with fewer than five, intervals say nothing.
        surfaces: names of `surfaces()`, or `module:Class`.
        paths: the leader's: names of `leader_paths()`, or `module:Class`.
        jobs: how many runs at the same time, each in a process of its own; 1: in this one, as are always those of
            a class of the running script or notebook (`__main__:Class`).
        out: folder of the results, in which the table of runs grows; a sweep that was stopped goes on there when the
            same is called again. None: nothing is written. Not for classes `__main__:Class`, which change.
        progress: whether to print to standard error how far it is.

    Raises:
        FormationError: naming what is misspelt or out of range, before anything is run; something that a run needs is
            not installed; the folder holds something else; or a run fails. Where a class from outside the package
            ended some runs, all others are done, and are the `Sweep` in the error's attribute `sweep`.
    """
    definition = definition_of(scenario)
    plan = sweeps.Plan(
        (scenario.name,),
        _names("surfaces", surfaces, scenario.surface),
        _names("predictors", predictors, scenario.predictor),
        _seeds(seeds),
        (),
        _names("paths", paths, scenario.path),
        _base(scenario),
    )
    jobs = whole_number("jobs", jobs, 1)
    folder = None if out is None else path_of("out", out)
    names = (*plan.predictors, *plan.surfaces, *plan.paths, definition.block_detector.sensor)
    if folder is not None and (edited := [name for name in names if name.startswith(plugins.NOTEBOOK)]):
        raise FormationError(
            f"out= keeps no runs of '{edited[0]}': the class may be another one next time; put it into a module"
        )
    check_one_process(definition)
    plan.check()
    table = None if folder is None else sweeps.Table(folder, plan)
    rows = {} if table is None else table.rows
    tasks = sweeps.remaining(plan, rows)
    if tasks:
        require("sim", "ros")
        found = sweep_runs.carry_out(tasks, (), plugins.processes(min(jobs, len(tasks)), names), plan.base)
        try:
            for row in with_progress(found, len(tasks)) if progress else found:
                if table is None:
                    rows[row.task] = row
                else:
                    table.add(row)
        except sweep_runs.FailedRunsError as error:
            error.sweep = Sweep(plan, tuple(sweeps.chosen(plan, rows)), folder)
            raise
    made = Sweep(plan, tuple(sweeps.chosen(plan, rows)), folder)
    if folder is not None:
        write_results(folder, plan, made.rows, made._summary)
    return made


def load_sweep(folder: str | os.PathLike[str]) -> Sweep:
    """Read the folder of a sweep, also of one that `formation sweep` has made, finished or not.

    Raises:
        FormationError: the folder holds no sweep, none of its runs is there, or a file is damaged.
    """
    path = path_of("folder", folder)
    plan, rows = sweeps.read_sweep(path)
    return Sweep(plan, tuple(rows), path)


def _base(scenario: Scenario) -> str:
    """Return what all runs of a sweep have in common, as JSON: without seed and predictor, which each run has."""
    content = scenario.to_dict()
    content.pop("seed", None)
    content.get("predictor", {}).pop("name", None)
    return json.dumps({name: value for name, value in content.items() if value != {}})


def _names(what: str, chosen: Sequence[str] | None, own: str) -> tuple[str, ...]:
    if chosen is None:
        return (own,)
    if isinstance(chosen, str) or not isinstance(chosen, Iterable):
        raise FormationError(
            f"{what} is a list of names, like {[chosen if isinstance(chosen, str) else own]}, not {shown(chosen)}"
        )
    return tuple(map(str, chosen))


def _seeds(chosen: Iterable[int]) -> tuple[int, ...]:
    if not isinstance(chosen, Iterable):
        raise FormationError(f"seeds are whole numbers, like range(20) or [7], not {shown(chosen)}")
    seeds = tuple(dict.fromkeys(whole_number("a seed", seed, 0) for seed in chosen))
    if not seeds:
        raise FormationError("no seed is given; range(20) is from 0 to 19")
    return seeds
