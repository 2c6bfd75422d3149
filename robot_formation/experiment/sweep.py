"""Many in-process runs over tracks, paths, surfaces, predictors and seeds; each yields one row of a table.

The table is a CSV file that grows row by row, so that a sweep which was stopped goes on where it was.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from robot_formation import plugins
from robot_formation.analysis.conditions import conditions
from robot_formation.analysis.quantities import analyse
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.resumable_table import ResumableTable, read_record, write_record
from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.noise_floor import IDEAL, IdealRun
from robot_formation.experiment.path_plan import STRAIGHT
from robot_formation.json_values import JsonObject
from robot_formation.koopman.predictors import NAMES, Predictor, PredictorParameters, check_predictor_name
from robot_formation.leader.paths import Teleop, check_path_name
from robot_formation.names import Message
from robot_formation.parameters import ParameterError, suggestion
from robot_formation.plugins import PluginError
from robot_formation.surface import check_surface_name

# The comparison's common ground unless --set says otherwise: the paper's fine-tuner, pictures only when waited for.
CONDITIONS = ("fine_tuner.mode=paper", "world.camera.mode=on_demand", "world.overhead.enabled=false")
RUNS_NAME = "runs.csv"
PLAN_NAME = "sweep.json"
_GOES_ON = "the same command with the same --out goes on"


class SweepError(FormationError):
    """A sweep can't be planned, or its folder can't be used."""


class Failure(NamedTuple):
    """A run that a class from outside the package has ended: which class, and the run with what was wrong."""

    subject: str
    text: str


class FailedRunsError(SweepError):
    """Runs that classes from outside the package have ended; all others of the sweep were done.

    Attributes:
        lines: one for each such class: its first failed run, and how many others failed.
    """

    def __init__(self, failures: Sequence[Failure]) -> None:
        """Take at least one failure."""
        texts: dict[str, list[str]] = {}
        for failure in failures:
            texts.setdefault(failure.subject, []).append(failure.text)
        self.lines = [_with_others(found[0], len(found) - 1) for found in texts.values()]
        super().__init__("; ".join(self.lines))


def _with_others(text: str, others: int) -> str:
    return f"{text} ({others} more of its runs failed)" if others else text


class Task(NamedTuple):
    """One run of a sweep."""

    track: str
    surface: str
    predictor: str
    seed: int
    path: str = STRAIGHT


@dataclass(frozen=True)
class Row:
    """What a run yields; quantities as in analysis.quantities, None where unavailable."""

    track: str
    surface: str
    predictor: str
    seed: int
    path: str
    outcome: str
    timesteps: int
    correction_m: float | None
    correction_u_m: float | None
    correction_v_m: float | None
    correction_turn_rad: float | None
    movements_per_timestep: float | None
    formation_error_rmse_m: float | None
    heading_error_rmse_rad: float | None
    prediction_coverage_90: float | None

    @property
    def task(self) -> Task:
        """The run that it is of."""
        return Task(self.track, self.surface, self.predictor, self.seed, self.path)

    @property
    def lost(self) -> bool:
        """Whether the run didn't come to its end: the leader was lost, or a robot left the plate."""
        return self.outcome != "done"


@dataclass(frozen=True)
class Plan:
    """What a sweep consists of: every combination, with settings KEY=VALUE for all of them."""

    tracks: tuple[str, ...]
    surfaces: tuple[str, ...]
    predictors: tuple[str, ...]
    seeds: tuple[int, ...]
    settings: tuple[str, ...] = ()
    paths: tuple[str, ...] = (STRAIGHT,)

    def turns_unfollowed(self, path: str) -> bool:
        """Whether a path turns, but the followers align by a mode that knows no heading."""
        task = Task(self.tracks[0], self.surfaces[0], self.predictors[0], self.seeds[0], path)
        return build(task, self.settings).turns_unfollowed

    def check(self) -> None:
        """Check every name and setting before anything is run.

        Raises:
            FormationError: naming what is misspelt or out of range.
        """
        for kind, chosen, check in (
            ("track", self.tracks, _check_track),
            ("surface", self.surfaces, check_surface_name),
            ("predictor", self.predictors, _check_predictor),
            ("path", self.paths, _check_path),
        ):
            if not chosen:
                raise SweepError(f"no {kind} is given")
            for name in chosen:
                check(name)
            if len(set(chosen)) != len(chosen):
                raise SweepError(f"a {kind} is given twice")
        if not self.seeds:
            raise SweepError("no seed is given; --seeds 0:200 is from 0 to 199")
        for setting in self.settings:
            if (key := setting.partition("=")[0]) in ("predictor.name", "world.surface", "seed", "leader.path"):
                raise SweepError(
                    f"--set {key}: a sweep sets it itself; use --predictors, --surfaces, --seeds or --paths"
                )
        plates: set[tuple[str, str, float]] = set()
        for track in self.tracks:
            for surface in self.surfaces:
                for path in self.paths:
                    scenario = build(Task(track, surface, self.predictors[0], self.seeds[0], path), self.settings)
                    scenario.check()
                    plate = (track, path, scenario.plate_m)
                    if plate not in plates:
                        self._check_seeds(scenario)
                    plates.add(plate)

    def _check_seeds(self, scenario: scenarios.Scenario) -> None:
        """Check the path with every seed: a random phase changes it, and with it the start and the steps."""
        first = scenario.leader.make_path()
        for seed in self.seeds[1:]:
            leader = replace(scenario.leader, seed=seed)
            if leader.make_path() != first:
                try:
                    scenario.check_path(leader)
                except ParameterError as error:
                    raise SweepError(f"seed {seed}: {error}") from None

    def conditions(self) -> JsonObject:
        """List the conditions of all runs by name, as those of a single run."""
        scenario = build(Task(self.tracks[0], self.surfaces[0], self.predictors[0], self.seeds[0]), self.settings)
        found = conditions(scenario.by_node(), [place.uv_m for place in scenario.slots])
        return {**found, "in_process": True}

    def tasks(self) -> Iterator[Task]:
        """Yield every run; all predictors of a seed together, so that an unfinished sweep has pairs."""
        for seed in self.seeds:
            for track in self.tracks:
                for path in self.paths:
                    for surface in self.surfaces:
                        for predictor in self.predictors:
                            yield Task(track, surface, predictor, seed, path)


def _check_track(name: str) -> None:
    if name not in scenarios.track_names():
        raise SweepError(f"no track '{name}'{suggestion(name, scenarios.track_names())}")


def _check_predictor(name: str) -> None:
    check_predictor_name(name, IDEAL)
    if name not in (*NAMES, *IDEAL):
        Predictor(PredictorParameters(name=name))  # imported and made before anything is run


def _check_path(name: str) -> None:
    if name == Teleop.name:
        raise SweepError(f"no path '{name}' in a sweep: a person drives it")
    check_path_name(name)


def build(task: Task, settings: Sequence[str]) -> scenarios.Scenario:
    """Build a run's scenario.

    Raises:
        FormationError: naming what is misspelt or out of range.
    """
    scenario = scenarios.with_surface(scenarios.load_track(task.track), task.surface)
    path = [] if task.path == STRAIGHT else [f"leader.path={task.path}"]
    predictor = {"ideal": "previous", "ideal+close": "formation"}.get(task.predictor, task.predictor)
    return scenarios.override(
        scenario, [*CONDITIONS, *settings, *path, f"predictor.name={predictor}", f"seed={task.seed}"]
    )


def run_task(task: Task, settings: Sequence[str]) -> Row:
    """Carry out one run.

    Raises:
        PluginError: if a class from outside the package fails; the text names the run.
        SweepError: if the scenario can't be run to an end for another reason; so does it.
    """

    def make_run(scenario: scenarios.Scenario, listen: Callable[[str, Message], None]) -> InProcessRun:
        if task.predictor in IDEAL:
            return IdealRun(scenario, listen, close=task.predictor == "ideal+close")
        return InProcessRun(scenario, listen=listen)

    try:
        analysis = analyse(run_in_memory(build(task, settings), make_run))
    except FormationError as error:
        path = "" if task.path == STRAIGHT else f", path {task.path}"
        run = f"track {task.track}{path}, surface {task.surface}, predictor {task.predictor}, seed {task.seed}"
        if isinstance(error, PluginError):
            raise PluginError(f"{error} ({run})") from None
        raise SweepError(f"{run}: {error}") from None
    totals = analysis.followers[0].totals
    # A sum of nothing is an integer 0, which the table would give back as another text.
    quantities: JsonObject = {
        field.name: None if totals[field.name] is None else float(totals[field.name]) for field in fields(Row)[7:]
    }
    return Row(
        *task,
        outcome=analysis.outcome,
        timesteps=totals["timesteps_finished"],
        **quantities,
    )


def _attempt(run: Callable[[Task, Sequence[str]], Row], task: Task, settings: Sequence[str]) -> Row | Failure:
    """Carry out one run; a class from outside that fails doesn't stop the others."""
    try:
        return run(task, settings)
    except PluginError as error:
        return Failure(plugins.subject(error), str(error))


def _rows(results: Iterable[Row | Failure]) -> Iterator[Row]:
    """Yield the rows, and raise FailedRunsError at the end if some runs gave none."""
    failures = []
    for result in results:
        if isinstance(result, Failure):
            failures.append(result)
        else:
            yield result
    if failures:
        raise FailedRunsError(failures)


class Table:
    """The growing CSV file of a sweep's folder."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        """Open a folder: a new one, or that of an earlier sweep with the same settings.

        Raises:
            SweepError: if the folder holds something else, or a sweep with other settings.
        """
        record = folder / PLAN_NAME
        if record.exists():
            self._require_same(record, plan)
        elif folder.exists() and any(folder.iterdir()):
            raise SweepError(f"{folder} is not empty and holds no sweep; choose another --out")
        folder.mkdir(parents=True, exist_ok=True)
        write_record(record, asdict(plan))
        self._table = _runs_table(folder, "choose another --out")
        self.rows: dict[Task, Row] = {}
        if self._table.path.exists():
            self.rows = {row.task: row for row in self._table.read()}
        self._table.rewrite(self.rows.values())

    def add(self, row: Row) -> None:
        """Append a row; it is on disk when this returns."""
        self.rows[row.task] = row
        self._table.append([row])

    @staticmethod
    def _require_same(record: Path, plan: Plan) -> None:
        try:
            settings = [str(setting) for setting in read_record(record)["settings"]]
        except (ValueError, KeyError, TypeError):
            raise SweepError(f"{record}: no record of a sweep; choose another --out") from None
        if settings != list(plan.settings):
            differing = _difference(settings, plan.settings)
            raise SweepError(f"{record.parent} holds a sweep with other settings: {differing}; choose another --out")


def _difference(earlier: Sequence[str], now: Sequence[str]) -> str:
    """Describe which settings of an earlier sweep differ from those of now."""
    gone = [setting for setting in earlier if setting not in now]
    new = [setting for setting in now if setting not in earlier]
    said = [f"it was made with --set {' --set '.join(gone)}"] if gone else []
    said += [f"{'and' if gone else 'it was made'} without --set {' --set '.join(new)}"] if new else []
    return " ".join(said) or f"it was made with them in another order, --set {' --set '.join(earlier)}"


def is_sweep(folder: Path) -> bool:
    """Return whether a folder is that of a sweep."""
    return (folder / PLAN_NAME).exists() and (folder / RUNS_NAME).exists()


def read_sweep(folder: Path) -> tuple[Plan, list[Row]]:
    """Read a sweep's folder: its latest plan, and those of its runs that are there, in order.

    Raises:
        SweepError: if the folder holds no sweep, none of its runs is there, or a file is damaged.
    """
    remedy = "give a folder that 'formation sweep' made"
    path = folder / PLAN_NAME
    try:
        record = read_record(path)
        names = ("tracks", "surfaces", "predictors", "settings")
        tracks, surfaces, predictors, settings = (tuple(map(str, record[name])) for name in names)
        paths = tuple(map(str, record.get("paths", (STRAIGHT,))))
        plan = Plan(tracks, surfaces, predictors, tuple(map(int, record["seeds"])), settings, paths)
    except (ValueError, KeyError, TypeError):
        raise SweepError(f"{path}: no record of a sweep; {remedy}") from None
    rows = chosen(plan, {row.task: row for row in _runs_table(folder, remedy).read()})
    if not rows:
        raise SweepError(f"{folder / RUNS_NAME} holds no run of the sweep yet; let 'formation sweep' go on")
    return plan, rows


def _runs_table(folder: Path, remedy: str) -> ResumableTable[Row]:
    foreign = f"no table of a sweep's runs; {remedy}"
    return ResumableTable(folder / RUNS_NAME, Row, SweepError, foreign, added={"path": STRAIGHT})


def remaining(plan: Plan, rows: Mapping[Task, Row]) -> list[Task]:
    """List the runs of a plan that are not in the table yet."""
    return [task for task in plan.tasks() if task not in rows]


def chosen(plan: Plan, rows: Mapping[Task, Row]) -> list[Row]:
    """List the rows of a plan, in its order."""
    return [rows[task] for task in plan.tasks() if task in rows]


def carry_out(tasks: Iterable[Task], settings: Sequence[str], jobs: int) -> Iterator[Row]:
    """Run tasks on this machine's cores by joblib; yield rows in the order of the tasks, each as soon as it is there.

    Raises:
        FailedRunsError: when all others are done, if a class from outside the package failed in some.
        SweepError: if a run can't come to its end for another reason, or a worker process dies.
    """
    try:
        yield from _rows(run_parallel(_attempt, ((run_task, task, settings) for task in tasks), jobs))
    except BrokenExecutor:
        raise SweepError(f"a worker process died (too little memory for --jobs {jobs}?); {_GOES_ON}") from None


def carry_out_by_dask(tasks: Iterable[Task], settings: Sequence[str], scheduler: str) -> Iterator[Row]:
    """Run tasks on a Dask cluster; yield rows as they come.

    Raises:
        FailedRunsError: when all others are done, if a class from outside the package failed in some.
        SweepError: if Dask isn't installed, the scheduler doesn't answer or goes away, or a run can't be done there.
    """
    try:
        from dask.distributed import Client, as_completed
    except ImportError:
        raise SweepError("--dask needs the package 'distributed'; pip install 'dask[distributed]'") from None
    # What happens to the connection is told in a line here, not by a traceback in its log.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise SweepError(f"no Dask scheduler answers at {scheduler}: {reason}") from None
    with client:
        futures = client.map(partial(_attempt, run_task, settings=settings), list(tasks), pure=False)
        yield from _rows(_result(future, scheduler) for future in as_completed(futures))


def _result(future: Any, scheduler: str) -> Row | Failure:
    """Return what a Dask worker has found.

    Raises:
        SweepError: if it has found nothing.
    """
    if future.cancelled():
        raise SweepError(f"the Dask cluster at {scheduler} is gone; {_GOES_ON}")
    problem = future.exception()
    if isinstance(problem, FormationError):
        raise problem
    if problem is not None:
        raise SweepError(f"a Dask worker can't do the runs: {type(problem).__name__}: {problem}; {_GOES_ON}")
    result: Row | Failure = future.result()
    return result
