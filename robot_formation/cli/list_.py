"""`formation list`: what can be named on the command line."""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from robot_formation.cli.parser import Subparsers
from robot_formation.parameters import specs

if TYPE_CHECKING:
    from robot_formation.experiment.scenario import Scenario


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser(
        "list",
        help="list tracks, scenarios, paths, surfaces, predictors, sensors and robots",
        description="List what can be named in other verbs.",
    )
    parser.add_argument(
        "what",
        nargs="?",
        choices=("tracks", "scenarios", "paths", "surfaces", "predictors", "sensors", "robots"),
        help="only these",
    )
    parser.add_argument("--json", action="store_true", help="machine-readable, on standard output")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the lists."""
    found = collect()
    if args.what:
        found = {args.what: found[args.what]}
    if args.json:
        print(json.dumps(found, indent=2))
        return 0
    width = shutil.get_terminal_size().columns
    for kind, entries in found.items():
        print(kind)
        for name, text in entries.items():
            print(_entry(name, text, width))
    return 0


def _entry(name: str, text: str, width: int) -> str:
    """Return a name and its description, wrapped at a terminal's width but never narrower than 40 characters."""
    head = f"  {name:<20} "
    return textwrap.fill(text, max(width, 40), initial_indent=head, subsequent_indent=" " * len(head))


def collect() -> dict[str, dict[str, str]]:
    """Collect names and descriptions by kind."""
    from robot_formation.experiment import scenario
    from robot_formation.koopman.predictors import DESCRIPTIONS
    from robot_formation.leader.paths import PATHS
    from robot_formation.leader.paths.outside import outside_path
    from robot_formation.plugins import load
    from robot_formation.surface import SURFACES
    from robot_formation.surface.outside import outside_surface
    from robot_formation.vision.sensors import SENSORS

    tracks = {}
    for name in scenario.track_names():
        loaded = scenario.load_track(name)
        setup, leader = loaded.setup, loaded.leader
        tracks[name] = (
            f"leader from ({setup.start_x_m * 100:.1f}, {setup.start_y_m * 100:.1f}) cm, "
            f"heading {setup.heading_deg:g} deg, "
            f"{leader.timesteps} timesteps of {leader.step_m * 100:g} cm"
        )
    return {
        "tracks": tracks,
        "scenarios": {name: _formation(scenario.load(path)) for name, path in scenario.formations().items()},
        "paths": {name: _path(kind) for name, kind in PATHS.items()} | _outside("path", outside_path, _path),
        "surfaces": {name: _first_line(kind) for name, kind in SURFACES.items()}
        | _outside("surface", outside_surface, _first_line),
        "predictors": DESCRIPTIONS | _outside("predictor", partial(load, "predictor"), _first_line),
        "sensors": SENSORS | _outside("sensor", partial(load, "sensor"), _first_line),
        "robots": {
            "leader": "drives the track, carries the tri-colour marker",
            "follower_1": "keeps 32 cm to the right of the leader; --set followers=N adds follower_2 .. follower_N",
        },
    }


def _formation(scenario: Scenario) -> str:
    """Describe a scenario of a formation."""
    setup, leader = scenario.setup, scenario.leader
    return (
        f"{setup.followers} followers, schedule {setup.schedule}, spacing {setup.spacing}; {leader.timesteps} "
        f"timesteps on a plate of {scenario.plate_m:g} x {scenario.plate_m:g} m"
    )


def _outside(kind: str, find: Callable[[str], type], describe: Callable[[type], str]) -> dict[str, str]:
    """Describe what other packages add, and where each comes from; what can't be used says why."""
    from robot_formation.plugins import PluginError, installed

    found = {}
    for name, plugin in installed(kind).items():
        try:
            found[name] = f"{describe(find(name))} [package {plugin.package}, {plugin.value}]".strip()
        except PluginError as error:
            found[name] = f"can't be used: {error}"
    return found


def _path(kind: type) -> str:
    return f"{_first_line(kind)} {_parameters(kind)}".strip()


def _parameters(kind: type) -> str:
    """List a path's parameters with their defaults; those that follow from elsewhere with the place.

    Where zero stands for a value that follows from other parameters, only the name is listed.
    """
    elsewhere = {"step_m": "leader.step_m", "phase": "by seed"}
    found = [
        name if spec.default == 0.0 and "0: " in spec.description else f"{name}={elsewhere.get(name, spec.default)}"
        for name, spec in specs(kind).items()
    ]
    return f"[{', '.join(found)}]" if found else ""


def _first_line(thing: Any) -> str:
    return next(iter((thing.__doc__ or "").strip().splitlines()), "")
