"""Calibrations and runs for the paper's figures, in one folder; what is there already is not repeated."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import RunAnalysis, analyse
from robot_formation.analysis.run_record import RunRecord
from robot_formation.bag.bag_path import PARTIAL_SUFFIX
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.resumable_table import read_record, write_record
from robot_formation.calibration.camera_files import evaluate
from robot_formation.calibration.camera_grid import Conditions, positions
from robot_formation.calibration.camera_report import VisionResult
from robot_formation.calibration.camera_run import carry_out, record_of
from robot_formation.calibration.camera_table import VisionTable
from robot_formation.calibration.encoder_comparison import DistanceComparison, Spread, compare_distances
from robot_formation.calibration.encoder_moves import measure_encoders
from robot_formation.calibration.motor_fit import AxisFit, FittedPoint
from robot_formation.calibration.motor_moves import calibrate_motors
from robot_formation.calibration.rig import CalibrationRig
from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment import sweep, sweep_runs
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import Scenario
from robot_formation.launching.processes import run_metadata

PREDICTORS = ("previous", "measured", "formation")
TRACKS = ("one", "two")
OWN_STARTS = ("one_baseline", "two_baseline")
RECORD_NAME = "paper.json"
SEED = 0
"""Of the calibrations and of the runs that are drawn."""
# A calibration of the overhead camera like the paper's, which has errors of centimetres.
_DRAWN = (*sweep.CONDITIONS, "world.overhead.enabled=true", "overhead_tracker.calibration=imperfect")
_MADE = ("calibrations", "vision", "bags", "runs", "runs_own_starts", RECORD_NAME)

# Processor seconds of a unit of each kind of work, for the time that is left; measured on a 2-core machine.
MOTORS_S, ENCODERS_S, POSITION_S, BAG_S, RUN_S, DRAWING_S = 15.0, 4.5, 0.11, 6.5, 5.0, 15.0

Drawn = dict[tuple[str, str], tuple[RunRecord, RunAnalysis]]
"""Runs that are drawn, by track and predictor."""
Fits = Mapping[str, Mapping[str, AxisFit]]


class PaperError(FormationError):
    """The folder can't be used, or its work can't be done."""


@dataclass(frozen=True)
class Work:
    """What is to be measured.

    Attributes:
        folder: of all files.
        seeds: number of seeds, from 0, of the runs that are compared.
        repeats: of the motors' and encoders' drives.
        step_m: of the camera's grid.
        settings: KEY=VALUE for all runs.
        jobs: processes.
    """

    folder: Path
    seeds: int = 10
    repeats: int = 10
    step_m: float = 0.05
    settings: tuple[str, ...] = ()
    jobs: int = 2

    @property
    def plans(self) -> dict[str, sweep.Plan]:
        """The runs that are compared, by the name of their folder."""
        seeds = tuple(range(self.seeds))
        return {
            "runs": sweep.Plan(TRACKS, ("bowl",), PREDICTORS, seeds, self.settings),
            "runs_own_starts": sweep.Plan(OWN_STARTS, ("bowl",), PREDICTORS[:1], seeds, self.settings),
        }

    @property
    def drawn(self) -> list[tuple[str, str]]:
        """Track and predictor of the runs that are drawn: same start, then without prediction from its own start."""
        return [(track, name) for track in TRACKS for name in PREDICTORS] + [
            (track, "previous") for track in OWN_STARTS
        ]

    def open(self, *, force: bool = False) -> None:
        """Make the folder, or go on in that of an earlier call.

        Args:
            force: whether to remove what an earlier call has measured.

        Raises:
            PaperError: if it holds something else, or was measured in another way.
            FormationError: on a setting that can't be.
        """
        for plan in self.plans.values():
            plan.check()
        record = self.folder / RECORD_NAME
        if self.folder.exists() and not self.folder.is_dir():
            raise PaperError(f"{self.folder} is no folder; choose another --out")
        own = {"repeats": self.repeats, "step_m": self.step_m, "settings": list(self.settings)}
        if force:
            for name in _MADE:
                shutil.rmtree(self.folder / name) if (self.folder / name).is_dir() else None
                (self.folder / name).unlink(missing_ok=True)
        if record.exists():
            try:
                earlier = read_record(record)
            except ValueError:
                raise PaperError(f"{record}: no record of 'formation paper'; choose another --out") from None
            for name in own:
                if earlier.get(name) != own[name]:
                    raise PaperError(
                        f"{self.folder} was made with {name} {earlier.get(name)} instead of {own[name]}; choose "
                        "another --out, or start anew with --force"
                    )
        elif not force and self.folder.exists() and any(self.folder.iterdir()):
            raise PaperError(f"{self.folder} is not empty and holds no figures of the paper; choose another --out")
        try:
            (self.folder / "calibrations").mkdir(parents=True, exist_ok=True)
            (self.folder / "bags").mkdir(exist_ok=True)
            write_record(record, own)
        except OSError as error:
            raise PaperError(f"{self.folder} can't be made: {error.strerror}; choose another --out") from error


class WorkProgress:
    """How much of the work is done and how long the rest will take, told to `say` now and then."""

    def __init__(self, total_s: float, say: Callable[[str], None], every_s: float = 5.0) -> None:
        self._total, self._say, self._every = total_s, say, every_s
        self._done = 0.0
        self._began = self._last = time.monotonic()

    def add(self, cost_s: float, what: str) -> None:
        """Count a unit as done."""
        self._done += cost_s
        now = time.monotonic()
        if now - self._last >= self._every:
            self._last = now
            left = (now - self._began) * max(0.0, self._total - self._done) / max(self._done, 1e-9)
            minutes, seconds = divmod(round(left), 60)
            share = min(99, round(100.0 * self._done / self._total))
            self._say(f"{share:2d} %  {what}, about {minutes}:{seconds:02d} left")


@dataclass(frozen=True)
class Results:
    """All that was measured."""

    fits: Fits
    encoders: list[DistanceComparison]
    vision: VisionResult
    drawn: Drawn
    rows: list[sweep.Row]
    scenario: Scenario


def carry_out_work(work: Work, picture_format: str, say: Callable[[str], None]) -> Results:
    """Measure what is missing, and return everything.

    Raises:
        FormationError: on a setting that can't be, or work that can't be done.
    """
    bench = scenarios.with_surface(scenarios.load_track("two"), "plane")
    bench.block_detector.load()
    places = positions(work.step_m, bench.world.chassis.width_m)
    conditions = Conditions(bench.world, bench.block_detector, bench.fine_tuner.look, SEED)
    looks = VisionTable(_made(work.folder / "vision"), record_of(conditions, work.step_m), places)
    left = looks.remaining(places)
    bags = [task for task in work.drawn if not bag_of(work, *task).exists()]
    tables = {name: sweep.Table(work.folder / name, plan) for name, plan in work.plans.items()}
    tasks = {name: sweep.remaining(plan, tables[name].rows) for name, plan in work.plans.items()}
    runs = sum(map(len, tasks.values()))
    progress = WorkProgress(_cost_s(work, len(left), len(bags), runs), say)
    _measure_drives(work, bench, progress)
    for samples in carry_out(left, conditions, min(work.jobs, len(left))) if left else ():
        looks.add(samples)
        progress.add(POSITION_S, "camera calibration")
    for track, predictor in _record(work, bags):
        progress.add(BAG_S, f"recorded track {track}, {predictor}")
    for name, missing in tasks.items():
        for row in sweep_runs.carry_out(missing, work.settings, min(work.jobs, len(missing))) if missing else ():
            tables[name].add(row)
            progress.add(RUN_S, "runs over seeds")
    tolerance_m = bench.fine_tuner.alignment.u_tolerance_m
    vision = evaluate(conditions, looks.all(places), work.folder / "vision", work.step_m, tolerance_m, picture_format)
    rows = [row for name, plan in work.plans.items() for row in sweep.chosen(plan, tables[name].rows)]
    drawn = {task: _loaded(bag_of(work, *task)) for task in work.drawn}
    scenario = scenarios.override(scenarios.load_track("two"), [*_DRAWN, *work.settings])
    fits, encoders = (_file(work, name) for name in ("motors", "encoders"))
    return Results(_fits(fits), _comparisons(encoders), vision, drawn, rows, scenario)


def _cost_s(work: Work, positions_left: int, bags: int, runs: int) -> float:
    """Return about how many processor seconds are left to do."""
    drives = sum(
        cost for name, cost in (("motors", MOTORS_S), ("encoders", ENCODERS_S)) if not _file(work, name).exists()
    )
    return drives + POSITION_S * positions_left + BAG_S * bags + RUN_S * runs + DRAWING_S


def _measure_drives(work: Work, bench: Scenario, progress: WorkProgress) -> None:
    """Calibrate the motors and compare the encoders, where that isn't done yet."""
    rig = CalibrationRig(bench.world.make_surface(), bench.world, SEED, 0.0)
    motors, encoders = (_file(work, name) for name in ("motors", "encoders"))
    if not motors.exists():
        fits = calibrate_motors(rig, bench.robots, bench.drive, work.repeats, _quiet)
        _write(motors, {robot: {axis: asdict(fit) for axis, fit in axes.items()} for robot, axes in fits.items()})
        progress.add(MOTORS_S, "motors calibrated")
    if not encoders.exists():
        drives = measure_encoders(rig, "follower_1", bench.drive, max(1, work.repeats // 2), _quiet)
        _write(encoders, [asdict(row) for row in compare_distances(drives)])
        progress.add(ENCODERS_S, "encoders compared")


def _quiet(text: str) -> None:
    """Say nothing: the progress of the whole is told."""


def _file(work: Work, name: str) -> Path:
    return work.folder / "calibrations" / f"{name}.json"


def bag_of(work: Work, track: str, predictor: str) -> Path:
    """Return where a drawn run is recorded."""
    return work.folder / "bags" / f"track_{track}_{predictor}"


def record_run(path: Path, track: str, predictor: str, settings: tuple[str, ...]) -> tuple[str, str]:
    """Record a drawn run; return its track and predictor.

    Raises:
        FormationError: if it can't be run.
    """
    shutil.rmtree(path.with_name(path.name + PARTIAL_SUFFIX), ignore_errors=True)  # of a call that was stopped
    chosen = [*_DRAWN, *settings, f"predictor.name={predictor}", f"seed={SEED}"]
    scenario = scenarios.override(scenarios.load_track(track), chosen)
    run_in_process(scenario, path, run_metadata(scenario))
    return track, predictor


def _record(work: Work, tasks: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    arguments = [(bag_of(work, *task), *task, work.settings) for task in tasks]
    if not arguments:
        return
    try:
        yield from run_parallel(record_run, arguments, min(work.jobs, len(arguments)))
    except BrokenExecutor:
        raise PaperError("a worker process died (too little memory?); the same command goes on") from None


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _loaded(bag: Path) -> tuple[RunRecord, RunAnalysis]:
    record = load_run(bag)
    return record, analyse(record)


def _write(path: Path, found: object) -> None:
    """Write a calibration's result; the file is there at once, and whole."""
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(found), encoding="utf-8")
    partial.replace(path)


def _read(path: Path, make: Callable[[Any], Any]) -> Any:
    try:
        return make(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise PaperError(f"{path} can't be read; delete it, and it is measured again") from None


def _fits(path: Path) -> Fits:
    def fit(found: Any) -> AxisFit:
        points = tuple(FittedPoint(**point) for point in found["points"])
        lack = {int(degree): float(deviate) for degree, deviate in found["lack_of_fit"].items()}
        return AxisFit(found["axis"], tuple(found["curve"]), points, lack)

    found: Fits = _read(path, lambda robots: {r: {a: fit(f) for a, f in axes.items()} for r, axes in robots.items()})
    return found


def _comparisons(path: Path) -> list[DistanceComparison]:
    spreads = ("motor_m", "sensing_m", "reference_m", "difference")

    def comparison(row: Any) -> DistanceComparison:
        values: dict[str, Any] = {name: Spread(**row[name]) if name in spreads else row[name] for name in row}
        return DistanceComparison(**values)

    found: list[DistanceComparison] = _read(path, lambda rows: [comparison(row) for row in rows])
    return found
