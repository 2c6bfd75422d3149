"""`formation calibrate`: a robot's motors and sensing wheels against the one-point reference, and its camera."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation.cli.calibrate_vision import DESCRIPTION as VISION_DESCRIPTION
from robot_formation.cli.calibrate_vision import add_options as add_vision_options
from robot_formation.cli.calibrate_vision import run_vision
from robot_formation.cli.calibration_options import build_scenario, free_folder
from robot_formation.cli.messages import say
from robot_formation.cli.option_types import option_type, whole_number
from robot_formation.cli.parser import Subparsers
from robot_formation.cli.picture_format import add_format
from robot_formation.errors import FormationError

if TYPE_CHECKING:
    from robot_formation.calibration.rig import CalibrationRig
    from robot_formation.experiment.scenario import Scenario

_COUNT = option_type(int, lambda value: 1 <= value <= 1000, "a whole number from 1 to 1000")
_LENGTH = option_type(float, lambda value: 0.0 <= value <= 0.1, "a length from 0 to 0.1 m")
DESCRIPTION = "Measure the robots of a scenario, each alone in the middle of the plate, or the follower's camera."
MOTORS_DESCRIPTION = """\
Drive each robot of the scenario over preset wheel rotations (followers along v and u, the leader along v, and turns),
measure the distances by the reference dot, fit the calibration curves, and write them to motors.yaml with a picture
(motors.png). 'formation run --set drive.calibration_file=FILE' uses them.
"""
ENCODERS_DESCRIPTION = """\
Drive a robot over preset distances along v and u and compare what its motors' encoders, its sensing wheels and the
reference dot say (encoders.png). --set drive.calibration_file=FILE takes the robot's own calibration curves.
"""
CALIBRATION_FILE = "motors.yaml"
MOTORS_PICTURE = "motors"
ENCODERS_PICTURE = "encoders"


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb and what it calibrates to the command line."""
    parser = subparsers.add_parser(
        "calibrate", help="measure motors, encoders or camera of a scenario's robots", description=DESCRIPTION
    )
    whats = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    motors = whats.add_parser("motors", help="fit wheel rotation to distance", description=MOTORS_DESCRIPTION)
    _add_options(motors)
    _add_drives(motors, repeats=10)
    motors.set_defaults(run=run_motors)
    encoders = whats.add_parser("encoders", help="compare the instruments", description=ENCODERS_DESCRIPTION)
    encoders.add_argument("--robot", metavar="NAME", default="follower_1", help="which robot (default: follower_1)")
    _add_options(encoders)
    _add_drives(encoders, repeats=5)
    encoders.set_defaults(run=run_encoders)
    vision = whats.add_parser(
        "vision", help="blocks around the neighbour: areas, pan and side-length curves", description=VISION_DESCRIPTION
    )
    _add_options(vision)
    add_vision_options(vision)
    vision.set_defaults(run=run_vision)


def _add_options(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--track", metavar="NAME", help="preset track whose robots are measured: one, two (default), ...")
    what.add_argument("--scenario", metavar="FILE", type=Path, help="scenario (file or name) whose robots are measured")
    parser.add_argument("--seed", metavar="N", type=whole_number, help="seed that the robots are drawn from")
    parser.add_argument("--surface", metavar="NAME", default="plane", help="ground to measure on (default: plane)")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="any parameter, as in 'run'; may be repeated"
    )
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="folder for the files (default: calibrations/SCENARIO_seedN)"
    )
    add_format(parser)
    parser.add_argument("--force", action="store_true", help="replace files of an older calibration")
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")


def _add_drives(parser: argparse.ArgumentParser, *, repeats: int) -> None:
    parser.add_argument(
        "--repeats",
        metavar="N",
        type=_COUNT,
        default=repeats,
        help=f"times each drive is made forth and back (default: {repeats})",
    )
    parser.add_argument(
        "--reference-noise",
        metavar="M",
        type=_LENGTH,
        default=0.0,
        help="standard deviation of the observer's x and y, in metres (default: 0)",
    )


def run_motors(args: argparse.Namespace) -> int:
    """Measure, fit, store, draw and print; return 0.

    Raises:
        FormationError: on anything wrong in the arguments, on files in the way, or if a curve can't be fitted.
    """
    from robot_formation.calibration.drive_check import robot_facts
    from robot_formation.calibration.motor_figures import draw_motors
    from robot_formation.calibration.motor_moves import calibrate_motors, curves
    from robot_formation.calibration.motor_report import motors_json, motors_text
    from robot_formation.drive.curves import MotorCalibration, save_calibration

    scenario = build_scenario(args, with_curves=False)
    name = f"{MOTORS_PICTURE}.{args.format}"
    folder = free_folder(args, scenario, (CALIBRATION_FILE, name))
    rig = make_rig(args, scenario)
    fits = calibrate_motors(rig, scenario.robots, scenario.drive, args.repeats, say)
    conditions = {**_conditions(args, scenario), **robot_facts(scenario.drive, scenario.world)}
    save_calibration(folder / CALIBRATION_FILE, MotorCalibration(curves(fits).robots, conditions))
    picture = draw_motors(fits, f"Motor calibration · {_told(args, scenario)}", folder / name)
    if args.json:
        said = {**_conditions(args, scenario), "file": str(folder / CALIBRATION_FILE), "picture": str(picture)}
        print(json.dumps({**said, "robots": motors_json(fits)}, indent=2, allow_nan=False))
        return 0
    print(f"motor calibration: {_told(args, scenario)}\n\n{motors_text(fits)}\n")
    print(f"curves: {folder / CALIBRATION_FILE}\npicture: {picture}")
    setting = f"drive.calibration_file={folder / CALIBRATION_FILE}"
    print(f"to use them: formation run --seed {scenario.setup.seed} --set {setting}")
    return 0


def run_encoders(args: argparse.Namespace) -> int:
    """Measure, compare, draw and print; return 0.

    Raises:
        FormationError: on anything wrong in the arguments, on files in the way, or if a drive can't be measured.
    """
    from robot_formation.calibration.drive_check import describe_curves
    from robot_formation.calibration.encoder_comparison import compare_distances
    from robot_formation.calibration.encoder_moves import measure_encoders
    from robot_formation.calibration.motor_figures import draw_encoders
    from robot_formation.calibration.motor_report import encoders_json, encoders_text
    from robot_formation.parameters import suggestion

    scenario = build_scenario(args, with_curves=True)
    if args.robot not in scenario.robots:
        raise FormationError(f"the scenario has no robot '{args.robot}'{suggestion(args.robot, scenario.robots)}")
    name = f"{ENCODERS_PICTURE}.{args.format}"
    folder = free_folder(args, scenario, (name,))
    say(describe_curves(scenario.drive))
    rig = make_rig(args, scenario)
    comparisons = compare_distances(measure_encoders(rig, args.robot, scenario.drive, args.repeats, say))
    title = f"{args.robot.replace('_', ' ')}, travelled distances · {_told(args, scenario)}"
    picture = draw_encoders(comparisons, title, folder / name)
    if args.json:
        said = {"robot": args.robot, **_conditions(args, scenario), "picture": str(picture)}
        said["calibration_file"] = scenario.drive.calibration_file or None
        print(json.dumps({**said, "distances": encoders_json(comparisons)}, indent=2, allow_nan=False))
        return 0
    print(f"{args.robot}: {_told(args, scenario)}\n\n{encoders_text(comparisons)}\n\npicture: {picture}")
    return 0


def make_rig(args: argparse.Namespace, scenario: Scenario) -> CalibrationRig:
    """Make the calibration rig of the scenario's ground and robots."""
    from robot_formation.calibration.rig import CalibrationRig

    return CalibrationRig(scenario.world.make_surface(), scenario.world, scenario.setup.seed, args.reference_noise)


def _conditions(args: argparse.Namespace, scenario: Scenario) -> dict[str, object]:
    return {
        "scenario": scenario.setup.name,
        "seed": scenario.setup.seed,
        "surface": scenario.world.surface,
        "repeats": args.repeats,
        "reference_noise_m": args.reference_noise,
    }


def _told(args: argparse.Namespace, scenario: Scenario) -> str:
    said = [f"seed {scenario.setup.seed}", scenario.world.surface, f"{args.repeats} times each way"]
    said += [f"reference noise {args.reference_noise * 1e3:g} mm"] if args.reference_noise else []
    return ", ".join(said)
