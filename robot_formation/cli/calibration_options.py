"""What all kinds of `formation calibrate` have in common: the scenario that is measured, and the output folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation.errors import FormationError

if TYPE_CHECKING:
    from robot_formation.experiment.scenario import Scenario


def build_scenario(args: argparse.Namespace, *, with_curves: bool) -> Scenario:
    """Return the scenario whose robots are measured, on the ground to measure on.

    Without curves, the calibration files that it names are left out: they may be what is to be measured only now.

    Raises:
        FormationError: naming what is misspelt or out of range.
    """
    from robot_formation.experiment import scenario as scenarios

    file, track = args.scenario, "two" if args.track is None else args.track
    scenario = scenarios.load(file) if file is not None else scenarios.load_track(track)
    scenario = scenarios.with_surface(scenario, args.surface)
    if args.seed is not None:
        scenario = scenarios.with_option(scenario, "seed", args.seed, "--seed")
    scenario = scenarios.override(scenario, args.set)
    if not with_curves:
        for node in ("drive", "fine_tuner"):
            scenario = scenarios.with_value(scenario, f"{node}.calibration_file", "")
    scenario.check()
    return scenario


def free_folder(args: argparse.Namespace, scenario: Scenario, files: tuple[str, ...]) -> Path:
    """Make the output folder.

    Raises:
        FormationError: if one of the files is there already and --force isn't given, or the folder can't be made.
    """
    folder = _folder_name(args, scenario)
    for name in files:
        if (folder / name).exists() and not args.force:
            raise FormationError(
                f"{folder / name} exists already and is not overwritten; choose another folder with --out, or "
                "replace it with --force"
            )
    return output_folder(args, scenario)


def output_folder(args: argparse.Namespace, scenario: Scenario) -> Path:
    """Make the output folder, whatever is in it.

    Raises:
        FormationError: if it can't be made.
    """
    folder = _folder_name(args, scenario)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FormationError(f"{folder} can't be made: {error.strerror}; choose another folder with --out") from error
    return folder


def _folder_name(args: argparse.Namespace, scenario: Scenario) -> Path:
    from robot_formation.paths import default_calibrations_dir

    folder: Path = args.out or default_calibrations_dir() / f"{scenario.setup.name}_seed{scenario.setup.seed}"
    return folder
