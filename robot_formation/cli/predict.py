"""`formation predict`: predictors on a displacement log, one timestep ahead or several."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import names
from robot_formation.analysis.limits import FARTHEST
from robot_formation.analysis.style import FORMATS
from robot_formation.cli.option_types import Names
from robot_formation.cli.parser import Subparsers
from robot_formation.cli.picture_format import add_format
from robot_formation.errors import FormationError

if TYPE_CHECKING:
    from robot_formation.analysis.displacement_log import DisplacementLog
    from robot_formation.analysis.forecasts import OneStepForecasts
    from robot_formation.koopman.predictors import PredictorParameters

DESCRIPTION = """\
Forecast every timestep of a displacement log from those before it, and compare the forecasts with what came: the ideal
move (displacement plus residual) if the log has residuals, else the displacement. LOG.csv has a header and the columns
u_m and v_m (metres, u to the right, v forward), and where they are known residual_u_m and residual_v_m (what was left
to go at the end), commanded_u_m and commanded_v_m (the displacement if the robot had gone exactly as told), turn_rad.
"""
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
    parser.add_argument(
        "--horizon",
        metavar="H",
        type=_horizon,
        default=0,
        help=f"judge forecasts of the ways of 1 to H timesteps too (up to {FARTHEST})",
    )
    parser.add_argument(
        "--columns",
        metavar="NAME=COLUMN,...",
        action=Names,
        default=(),
        help="what the file calls its columns, like u_m=dx,v_m=dy,turn_rad=dyaw",
    )
    parser.add_argument("--unit", choices=("m", "cm", "mm"), help="unit of lengths in the file (default: m)")
    parser.add_argument("--skip-bad", action="store_true", help="leave bad rows out and say how many there were")
    picture = parser.add_mutually_exclusive_group()
    picture.add_argument(
        "--figure",
        metavar="FILE",
        type=_picture,
        help="picture of up to three predictors: .png, .svg or .pdf (default: LOG_forecasts.png beside the log, or "
        "forecasts.png in <BAG>_analysis)",
    )
    picture.add_argument("--no-figure", action="store_true", help="draw no picture")
    add_format(parser, default=None)
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

    from robot_formation.analysis.forecasts import best_of, error_table, forecast_log
    from robot_formation.experiment.predictor_choice import predictors_of_texts

    chosen = predictors_of_texts(args.predictors, args.set)
    log = read(args, chosen[0])
    forecasts = []
    for parameters in chosen:
        if len(log) >= _LONG:
            print(f"{parameters.name}: {len(log)} timesteps", file=sys.stderr, flush=True)
        forecasts.append(forecast_log(log, parameters, args.horizon))
    picture = _draw(args, log, forecasts)
    _warn_of_bounds(log, chosen[0])
    if args.json:
        told = {"predictors": {found.name: found.to_json() for found in forecasts}, "best": best_of(forecasts)}
        print(json.dumps(told, allow_nan=False))
        return 0
    print(error_table(log, forecasts))
    written = [(label, path) for label, path in (("log", args.out), ("picture", picture)) if path is not None]
    if written:
        print("\n" + "\n".join(f"{label}: {path}" for label, path in written))
    return 0


def read(args: argparse.Namespace, parameters: PredictorParameters) -> DisplacementLog:
    """Read the log from its file or bag, and write a bag's log if that is asked for.

    With --skip-bad, rows that no predictor would take are left out.

    Raises:
        FormationError: the log can't be read or written.
    """
    from robot_formation.analysis.displacement_log import read_log, write_log

    if args.bag is None:
        for option in ("robot", "namespace", "out"):
            if getattr(args, option) is not None:
                raise FormationError(f"--{option} belongs to --bag; leave it out, or give a bag instead of a log")
        log = read_log(args.log, columns=_columns(args.columns), unit=args.unit or "m", skip_bad=args.skip_bad)
        return _without_absurd(log, parameters) if args.skip_bad else log
    for option, given in (("columns", args.columns), ("unit", args.unit), ("skip-bad", args.skip_bad)):
        if given:
            raise FormationError(f"--{option} belongs to a log; a bag's displacements are in metres and complete")
    # Imported here, so that a log doesn't pay for rosbags.
    from robot_formation.analysis.from_bag import load_displacements

    log = load_displacements(args.bag, args.robot or names.follower(1), args.namespace)
    if args.out is not None:
        write_log(log, args.out)
    return log


def _columns(texts: Sequence[str]) -> dict[str, str]:
    from robot_formation.analysis.displacement_log import COLUMNS
    from robot_formation.parameters import suggestion

    found: dict[str, str] = {}
    for text in texts:
        name, sign, column = (part.strip() for part in text.partition("="))
        if not sign or not column:
            raise FormationError(f"--columns: '{text}' is no NAME=COLUMN, like u_m=dx")
        if name not in COLUMNS:
            raise FormationError(f"--columns: no '{name}' in a log{suggestion(name, COLUMNS)}")
        if name in found or column in found.values():
            raise FormationError(f"--columns: '{text}' names what is named already; name each once")
        found[name] = column
    return found


def _without_absurd(log: DisplacementLog, parameters: PredictorParameters) -> DisplacementLog:
    """Leave out rows that predictors refuse, and say on standard error how many are missing in all."""
    import numpy as np

    bound = 10.0 * np.array([parameters.max_u_m, parameters.max_v_m])
    good = np.ones(len(log), dtype=bool)
    for values in (log.displacements_m, log.residuals_m, log.commanded_m):
        good &= ~(np.abs(values) > bound).any(axis=1)
    good &= np.abs(log.turns_rad) <= 10.0 * parameters.max_turn_rad
    count = len(log.skipped) + int((~good).sum())
    if not good.any():
        raise FormationError(f"{log.source} has no row that predictors take; correct it, or give --unit")
    if count:
        first = log.skipped[0] if log.skipped else f"{log.source}, {log.places[int(np.argmin(good))]}: too long"
        print(f"warning: {count} bad row(s) left out; the first: {first}", file=sys.stderr)
    return replace(
        log,
        places=tuple(place for place, kept in zip(log.places, good, strict=True) if kept),
        displacements_m=log.displacements_m[good],
        residuals_m=log.residuals_m[good],
        commanded_m=log.commanded_m[good],
        turns_rad=log.turns_rad[good],
    )


def _draw(args: argparse.Namespace, log: DisplacementLog, forecasts: Sequence[OneStepForecasts]) -> Path | None:
    """Draw the picture, if one is wanted; return its path."""
    path: Path | None = args.figure
    if path is not None and args.format is not None and path.suffix.lower() != f".{args.format}":
        raise FormationError(f"--figure {path} is no {args.format}; leave --format out, its name's ending says it")
    if path is None:
        if args.no_figure or args.json:
            return None
        path = _default_picture(args)
    from robot_formation.analysis.forecast_figures import MOST_DRAWN, draw_forecasts
    from robot_formation.analysis.forecasts import best_of

    wanted = list(args.predictors or _DRAWN)[:MOST_DRAWN]
    best = best_of(forecasts)
    if best is not None and best not in wanted:  # it takes the place of the last one but 'formation'
        others = [name for name in wanted if name != "formation"]
        wanted = [name for name in wanted if name != others[-1]] if len(wanted) == MOST_DRAWN else wanted
        wanted.append(best)
    return draw_forecasts(log, [found for found in forecasts if found.name in wanted][:MOST_DRAWN], path, best)


def _default_picture(args: argparse.Namespace) -> Path:
    kind = args.format or FORMATS[0]
    if args.bag is None:
        log: Path = args.log
        return log.with_name(f"{log.stem}_forecasts.{kind}")
    from robot_formation.analysis.report import made_folder, pictures_folder

    return made_folder(pictures_folder(args.bag)) / f"forecasts.{kind}"


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


def _horizon(text: str) -> int:
    """An argparse type for a number of timesteps."""
    if not text.isdecimal() or not 1 <= int(text) <= FARTHEST:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of timesteps from 1 to {FARTHEST}")
    return int(text)


def _picture(text: str) -> Path:
    """An argparse type for a file of a picture."""
    path = Path(text)
    if path.suffix.lower().removeprefix(".") not in FORMATS:
        endings = ", ".join(f".{kind}" for kind in FORMATS)
        raise argparse.ArgumentTypeError(f"{text!r} is no picture: end its name with {endings}")
    return path
