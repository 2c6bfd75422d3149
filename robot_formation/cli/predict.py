"""`formation predict`: predictors on a displacement log, one step ahead."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import names
from robot_formation.cli.option_types import Names
from robot_formation.cli.parser import Subparsers
from robot_formation.errors import FormationError

if TYPE_CHECKING:
    from robot_formation.analysis.displacement_log import DisplacementLog
    from robot_formation.analysis.forecasts import OneStepForecasts
    from robot_formation.koopman.predictors import PredictorParameters

DESCRIPTION = """\
Forecast every timestep of a displacement log from those before it, and compare the forecasts with what came: the ideal
move (displacement plus residual) if the log has residuals, else the displacement. LOG.csv has a header and the columns
u_m and v_m (metres, u to the right, v forward), and where they are known residual_u_m and residual_v_m (what was left
to go at the end), commanded_u_m and commanded_v_m (the displacement if the robot had gone exactly as told).
"""
_SUFFIXES = (".png", ".pdf", ".svg")
_DRAWN = ("previous", "measured", "formation")
"""What the picture shows if no predictors are named."""
_LONG = 20_000
"""Rows from which on a predictor takes long enough to be announced."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("predict", help="one-step forecasts on a displacement log", description=DESCRIPTION)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("log", metavar="LOG.csv", type=Path, nargs="?", help="displacement log")
    source.add_argument("--bag", metavar="BAG", type=Path, help="take the log out of a recorded run instead")
    parser.add_argument("--robot", metavar="NAME", help=f"with --bag: whose log (default: {names.follower(1)})")
    parser.add_argument(
        "--namespace",
        metavar="NS",
        help="with --bag: the formation's namespace, where the bag holds several formations",
    )
    parser.add_argument("--out", metavar="LOG.csv", type=Path, help="with --bag: write its log into this new file")
    parser.add_argument(
        "--predictors",
        metavar="NAME,...",
        action=Names,
        default=(),
        help="previous, measured, ewma+close, ...; may be repeated (default: all of 'formation list predictors')",
    )
    # As 'formation run' calls it. Listed once only.
    parser.add_argument("--predictor", dest="predictors", action=Names, default=(), help=argparse.SUPPRESS)
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="parameter of the predictors, like predictor.forgetting=0.95; may be repeated",
    )
    picture = parser.add_mutually_exclusive_group()
    picture.add_argument(
        "--figure",
        metavar="FILE",
        type=_picture,
        help="picture of up to three predictors: .png, .pdf or .svg (default: LOG_forecasts.png beside the log, or "
        "forecasts.png in <BAG>_analysis)",
    )
    picture.add_argument("--no-figure", action="store_true", help="draw no picture")
    parser.add_argument(
        "--json", action="store_true", help="print JSON and nothing else; a picture is drawn only if --figure is given"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Forecast, print and draw; return 0.

    Raises:
        FormationError: an option is wrong, the log can't be read, or a row of it can't be used.
    """
    # Imported here, so that the other verbs don't pay for NumPy.
    import json

    from robot_formation.analysis.forecasts import error_table, forecast_log

    chosen = predictors(args.predictors, args.set)
    log = read(args)
    forecasts = []
    for parameters in chosen:
        if len(log) >= _LONG:
            print(f"{parameters.name}: {len(log)} timesteps", file=sys.stderr, flush=True)
        forecasts.append(forecast_log(log, parameters))
    picture = _draw(args, log, forecasts)
    _warn_of_bounds(log, chosen[0])
    if args.json:
        print(json.dumps({"predictors": {found.name: found.to_json() for found in forecasts}}, allow_nan=False))
        return 0
    print(error_table(log, forecasts))
    written = [(label, path) for label, path in (("log", args.out), ("picture", picture)) if path is not None]
    if written:
        print("\n" + "\n".join(f"{label}: {path}" for label, path in written))
    return 0


def predictors(chosen: Sequence[str], settings: Sequence[str]) -> list[PredictorParameters]:
    """Return each predictor's parameters: the defaults, then the settings.

    Raises:
        FormationError: naming what is misspelt, out of range or of another node.
    """
    from robot_formation.experiment.scenario import Setup, build, override
    from robot_formation.koopman.predictors import NAMES
    from robot_formation.parameters import suggestion

    for name in chosen:
        if name not in NAMES:
            raise FormationError(f"--predictors: no predictor '{name}'{suggestion(name, NAMES)}")
    scenario = override(build(Setup(), {}), settings)
    for setting in settings:
        if not setting.startswith("predictor."):
            raise FormationError(f"--set {setting}: a log has no scenario; set parameters like predictor.forgetting")
    if "name" in scenario.settings.get("predictor", {}):
        raise FormationError("--set predictor.name: name predictors by --predictors NAME,...")
    return [replace(scenario.predictor, name=name) for name in dict.fromkeys(chosen or NAMES)]


def read(args: argparse.Namespace) -> DisplacementLog:
    """Read the log from its file or bag, and write a bag's log if that is asked for.

    Raises:
        FormationError: the log can't be read or written.
    """
    from robot_formation.analysis.displacement_log import read_log, write_log

    if args.bag is None:
        for option in ("robot", "namespace", "out"):
            if getattr(args, option) is not None:
                raise FormationError(f"--{option} belongs to --bag; leave it out, or give a bag instead of a log")
        return read_log(args.log)
    # Imported here, so that a log doesn't pay for rosbags.
    from robot_formation.analysis.from_bag import load_displacements

    log = load_displacements(args.bag, args.robot or names.follower(1), args.namespace)
    if args.out is not None:
        write_log(log, args.out)
    return log


def _draw(args: argparse.Namespace, log: DisplacementLog, forecasts: Sequence[OneStepForecasts]) -> Path | None:
    """Draw the picture, if one is wanted; return its path."""
    path: Path | None = args.figure
    if path is None:
        if args.no_figure or args.json:
            return None
        path = _default_picture(args)
    from robot_formation.analysis.forecast_figures import MOST_DRAWN, draw_forecasts

    wanted = args.predictors or _DRAWN
    return draw_forecasts(log, [found for found in forecasts if found.name in wanted][:MOST_DRAWN], path)


def _default_picture(args: argparse.Namespace) -> Path:
    if args.bag is None:
        log: Path = args.log
        return log.with_name(f"{log.stem}_forecasts.png")
    from robot_formation.analysis.report import made_folder, pictures_folder

    return made_folder(pictures_folder(args.bag)) / "forecasts.png"


def _warn_of_bounds(log: DisplacementLog, parameters: PredictorParameters) -> None:
    """Warn if forecasts are cut to bounds that the log itself goes beyond."""
    for axis, bound_m in enumerate((parameters.max_u_m, parameters.max_v_m)):
        beyond = int((abs(log.displacements_m[:, axis]) > bound_m).sum())
        if beyond:
            name = f"predictor.max_{'uv'[axis]}_m"
            print(
                f"warning: {beyond} displacement(s) longer than {name}={bound_m:g}, to which forecasts are cut; "
                f"raise it by --set {name}=...",
                file=sys.stderr,
            )


def _picture(text: str) -> Path:
    """An argparse type for a file of a picture."""
    path = Path(text)
    if path.suffix.lower() not in _SUFFIXES:
        raise argparse.ArgumentTypeError(f"{text!r} is no picture: end its name with {', '.join(_SUFFIXES)}")
    return path
