"""`formation calibrate vision`: the camera's pictures at places around the neighbour, and the curves that follow."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_formation import exit_codes
from robot_formation.analysis.style import FORMATS
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.calibration_options import build_scenario, output_folder
from robot_formation.cli.option_types import number, whole_number
from robot_formation.errors import FormationError

if TYPE_CHECKING:
    from robot_formation.calibration.camera_grid import Conditions, Position
    from robot_formation.calibration.camera_report import VisionResult
    from robot_formation.experiment.scenario import Scenario

DESCRIPTION = """\
Place the follower's camera at every 5 cm of -45 to 45 cm along u and v around its beacon neighbour and at nine relative
angles, and look (with two finer sets parallel to the neighbour). Blocks go into a table (vision.csv) and a bag
(vision_bag). From them: the areas (vision_areas.png), the pan curves (vision_pan.png), the side-length curve
(vision_side.png), and the fine-tuner's values (vision.yaml). 'formation run --set fine_tuner.calibration_file=FILE'
uses them. A calibration that was stopped goes on when the same command is given again.
"""
_STEP_M = 0.05


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what only this calibration has."""
    parser.add_argument(
        "--step", metavar="M", type=number, default=_STEP_M, help=f"step of the grid, in metres (default: {_STEP_M})"
    )
    parser.add_argument(
        "--jobs", metavar="N", type=whole_number, default=os.cpu_count() or 1, help="looks at the same time"
    )


def run_vision(args: argparse.Namespace) -> int:
    """Look, record, fit, store, draw and print; return 0, or 130 when interrupted.

    Raises:
        FormationError: on anything wrong in the arguments or the folder, or if the curves can't be fitted.
    """
    from robot_formation.calibration.camera_files import CALIBRATION_FILE, evaluate, picture_paths
    from robot_formation.calibration.camera_grid import positions
    from robot_formation.calibration.camera_run import BAG_NAME, record_of
    from robot_formation.calibration.camera_table import RECORD_NAME, TABLE_NAME, VisionTable
    from robot_formation.extras import require

    if args.jobs < 1:
        raise FormationError(f"--jobs is at least 1, not {args.jobs}")
    scenario = build_scenario(args, with_curves=False)
    conditions = conditions_of(scenario)
    places = positions(args.step, conditions.world.chassis.width_m)
    folder = output_folder(args, scenario)
    if args.force:
        drawn = [path.name for kind in FORMATS for path in picture_paths(folder, kind).values()]
        _clear(folder, (RECORD_NAME, TABLE_NAME, CALIBRATION_FILE, *drawn, BAG_NAME))
    if not (folder / BAG_NAME).exists():
        require("ros")  # to write it
    table = VisionTable(folder, record_of(conditions, args.step), places)
    try:
        _look(table, places, conditions, args.jobs)
        tolerance_m = scenario.fine_tuner.alignment.u_tolerance_m
        result = evaluate(conditions, table.all(places), folder, args.step, tolerance_m, args.format)
    except KeyboardInterrupt:
        print(f"\nformation calibrate: interrupted; the same command goes on in {folder}", file=sys.stderr)
        return exit_codes.INTERRUPTED
    _print(args, scenario, result, folder)
    return exit_codes.DONE


def _look(table: Any, places: list[Position], conditions: Conditions, jobs: int) -> None:
    from robot_formation.calibration.camera_run import carry_out

    todo = table.remaining(places)
    if not todo:
        return
    if len(todo) < len(places):
        done = len(places) - len(todo)
        print(f"{table.path}: {done} positions are there already, {len(todo)} are left", file=sys.stderr)
    found = carry_out(todo, conditions, min(jobs, len(todo)))
    for samples in with_progress(found, len(todo), "positions"):
        table.add(samples)


def _print(args: argparse.Namespace, scenario: Scenario, result: VisionResult, folder: Path) -> None:
    from robot_formation.calibration.camera_files import CALIBRATION_FILE, picture_paths
    from robot_formation.calibration.camera_report import vision_json, vision_text
    from robot_formation.calibration.camera_run import BAG_NAME
    from robot_formation.calibration.camera_table import TABLE_NAME

    files = {"table": folder / TABLE_NAME, "bag": folder / BAG_NAME, "file": folder / CALIBRATION_FILE}
    pictures = {name: str(picture) for name, picture in picture_paths(folder, args.format).items()}
    if args.json:
        said = {
            "scenario": scenario.setup.name,
            "seed": scenario.setup.seed,
            "surface": scenario.world.surface,
            "step_m": args.step,
            **{name: str(path) for name, path in files.items()},
            "pictures": pictures,
        }
        print(json.dumps({**said, **vision_json(result)}, indent=2, allow_nan=False))
        return
    print(f"camera calibration: {_told(scenario)}\n\n{vision_text(result)}\n")
    print(f"table: {files['table']}\nbag: {files['bag']}\npictures: {', '.join(pictures.values())}")
    print(f"calibration: {files['file']}")
    print(f"to use it: formation run --set fine_tuner.calibration_file={files['file']}")


def conditions_of(scenario: Scenario) -> Conditions:
    """Return the looks' conditions in a scenario.

    Raises:
        SignatureError: the taught signatures can't be read.
    """
    from robot_formation.calibration.camera_grid import Conditions

    scenario.block_detector.load()
    return Conditions(scenario.world, scenario.block_detector, scenario.fine_tuner.look, scenario.setup.seed)


def _clear(folder: Path, names: tuple[str, ...]) -> None:
    for name in names:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def _told(scenario: Scenario) -> str:
    return f"seed {scenario.setup.seed}, {scenario.world.surface}"
