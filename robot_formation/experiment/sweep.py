"""Many in-process runs over tracks, paths, surfaces, predictors and seeds; each yields one row of a table.

The table is a CSV file that grows row by row, so that a sweep which was stopped goes on where it was.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from robot_formation.analysis.conditions import conditions
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.run_record import RunRecord
from robot_formation.batch.resumable_table import ResumableTable, read_record, write_record
from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.path_plan import STRAIGHT
from robot_formation.json_values import JsonObject
from robot_formation.koopman.predictors import NAMES, Predictor, PredictorParameters, check_predictor_name
from robot_formation.leader.paths import Teleop, check_path_name
from robot_formation.parameters import ParameterError, suggestion
from robot_formation.plugins import PluginError
from robot_formation.surface import check_surface_name

if TYPE_CHECKING:
    from robot_formation.experiment.in_process import InProcessRun
    from robot_formation.names import Message

# The comparison's common ground unless --set says otherwise: the paper's fine-tuner, pictures only when waited for.
CONDITIONS = ("fine_tuner.mode=paper", "world.camera.mode=on_demand", "world.overhead.enabled=false")
# The noise floor's moves instead of a predictor's, and which predictor runs with them (see noise_floor.py).
IDEAL = {"ideal": "previous", "ideal+close": "formation"}
RUNS_NAME = "runs.csv"
PLAN_NAME = "sweep.json"


class SweepError(FormationError):
    """A sweep can't be planned, or its folder can't be used."""


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
    """What a sweep consists of: every combination, with settings KEY=VALUE for all of them.

    Attributes:
        base: a scenario as JSON, of which all runs are made just as it is; its name then is the only track. Empty: the
            runs are made of preset tracks, under `CONDITIONS`.
    """

    tracks: tuple[str, ...]
    surfaces: tuple[str, ...]
    predictors: tuple[str, ...]
    seeds: tuple[int, ...]
    settings: tuple[str, ...] = ()
    paths: tuple[str, ...] = (STRAIGHT,)
    base: str = ""

    def build(self, task: Task) -> scenarios.Scenario:
        """Build the scenario of one run. Errors as for `build`."""
        return build(task, self.settings, self.base)

    def turns_unfollowed(self, path: str) -> bool:
        """Whether a path turns, but the followers align by a mode that knows no heading."""
        task = Task(self.tracks[0], self.surfaces[0], self.predictors[0], self.seeds[0], path)
        return self.build(task).turns_unfollowed

    def check(self) -> None:
        """Check every name and setting before anything is run.

        Raises:
            FormationError: naming what is misspelt or out of range.
        """
        for kind, chosen, check in (
            ("track", self.tracks, _accept if self.base else _check_track),
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
                    scenario = self.build(Task(track, surface, self.predictors[0], self.seeds[0], path))
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
        path = self.paths[0] if self.base else STRAIGHT
        scenario = self.build(Task(self.tracks[0], self.surfaces[0], self.predictors[0], self.seeds[0], path))
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


def _accept(name: str) -> None:
    pass


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


def build(task: Task, settings: Sequence[str], base: str = "") -> scenarios.Scenario:
    """Build a run's scenario.

    Args:
        task: the run.
        settings: KEY=VALUE each.
        base: see `Plan`.

    Raises:
        FormationError: naming what is misspelt or out of range.
    """
    predictor = IDEAL.get(task.predictor, task.predictor)
    if base:
        scenario = scenarios.from_content(json.loads(base), where="the sweep's scenario")
        if task.surface != scenario.world.surface:
            scenario = scenarios.with_surface(scenario, task.surface)
        chosen = [("leader.path", task.path)] if task.path != scenario.leader.path else []
        return scenarios.with_values(
            scenario, [*chosen, ("predictor.name", predictor), ("seed", task.seed)], source="sweep"
        )
    scenario = _track_on(task.track, task.surface)
    path = [] if task.path == STRAIGHT else [f"leader.path={task.path}"]
    return scenarios.override(
        scenario, [*CONDITIONS, *settings, *path, f"predictor.name={predictor}", f"seed={task.seed}"]
    )


@lru_cache(maxsize=16)
def _track_on(track: str, surface: str) -> scenarios.Scenario:
    """Return a preset track on a surface; the same for many runs."""
    return scenarios.with_surface(scenarios.load_track(track), surface)


def run_task(task: Task, settings: Sequence[str], base: str = "") -> Row:
    """Carry out one run; for the arguments see `build`.

    Raises:
        PluginError: if a class from outside the package fails; the text names the run.
        SweepError: if the scenario can't be run to an end for another reason; so does it.
    """
    try:
        return run_to_row(task, settings, base)
    except FormationError as error:
        path = "" if task.path == STRAIGHT else f", path {task.path}"
        run = f"track {task.track}{path}, surface {task.surface}, predictor {task.predictor}, seed {task.seed}"
        if isinstance(error, PluginError):
            raise PluginError(f"{error} ({run})") from None
        raise SweepError(f"{run}: {error}") from None


def run_to_row(task: Task, settings: Sequence[str], base: str = "") -> Row:
    """Carry out one run; errors don't name it. For the arguments see `build`.

    Raises:
        FormationError: if the scenario can't be run to an end, or a class from outside the package fails.
    """
    analysis = analyse(_carry_out(task, build(task, settings, base)))
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


def _carry_out(task: Task, scenario: scenarios.Scenario) -> RunRecord:
    # Here, so that who only reads sweeps needs neither ROS nor PyBullet.
    from robot_formation.experiment.in_memory_record import run_in_memory
    from robot_formation.experiment.in_process import InProcessRun
    from robot_formation.experiment.noise_floor import IdealRun

    def make_run(scenario: scenarios.Scenario, listen: Callable[[str, Message], None]) -> InProcessRun:
        if task.predictor in IDEAL:
            return IdealRun(scenario, listen, close=task.predictor == "ideal+close")
        return InProcessRun(scenario, listen=listen)

    return run_in_memory(scenario, make_run, ground=False)


class Table:
    """The growing CSV file of a sweep's folder."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        """Open a folder: a new one, or that of an earlier sweep with the same settings.

        Raises:
            SweepError: if the folder holds something else, or a sweep with other settings.
        """
        record = folder / PLAN_NAME
        try:
            if record.exists():
                plan = self._same(record, plan)
            elif folder.exists() and any(folder.iterdir()):
                raise SweepError(f"{folder} is not empty and holds no sweep; choose another folder")
            folder.mkdir(parents=True, exist_ok=True)
            write_record(record, asdict(plan))
        except OSError as error:
            problem = error.strerror or error
            raise SweepError(f"{folder} can't be used: {problem}; choose another folder") from error
        self._table = _runs_table(folder, "choose another folder")
        self.rows: dict[Task, Row] = {}
        if self._table.path.exists():
            self.rows = {row.task: row for row in self._table.read()}
        self._table.rewrite(self.rows.values())

    def add(self, row: Row) -> None:
        """Append a row; it is on disk when this returns."""
        self.rows[row.task] = row
        self._table.append([row])

    @staticmethod
    def _same(record: Path, plan: Plan) -> Plan:
        """Return the plan with the recorded base, which all rows so far were made of."""
        try:
            known = read_record(record)
            settings = [str(setting) for setting in known["settings"]]
            base = str(known.get("base", ""))
        except (ValueError, KeyError, TypeError):
            raise SweepError(f"{record}: no record of a sweep; choose another folder") from None
        if not _same_runs(plan, base):
            raise SweepError(f"{record.parent} holds a sweep of another scenario; choose another folder")
        if settings != list(plan.settings):
            differing = _difference(settings, plan.settings)
            raise SweepError(f"{record.parent} holds a sweep with other settings: {differing}; choose another folder")
        return replace(plan, base=base)


def _same_runs(plan: Plan, base: str) -> bool:
    """Whether a plan's runs would be the same with another base: values may be given there, or be the defaults."""
    if not base or not plan.base:
        return base == plan.base
    other = replace(plan, base=base)
    for surface, path in itertools.product(plan.surfaces, plan.paths):
        task = Task(plan.tracks[0], surface, plan.predictors[0], plan.seeds[0], path)
        now = plan.build(task)
        try:
            then = other.build(task)
        except (FormationError, ValueError, TypeError, AttributeError, RecursionError):  # a damaged record
            return False
        if (now.setup, now.by_node()) != (then.setup, then.by_node()):
            return False
    return True


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
        seeds, base = tuple(map(int, record["seeds"])), str(record.get("base", ""))
        if base and not isinstance(json.loads(base), dict):
            raise TypeError
        plan = Plan(tracks, surfaces, predictors, seeds, settings, paths, base)
    except (ValueError, KeyError, TypeError, RecursionError):
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
