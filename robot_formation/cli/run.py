"""`formation run`: a scenario through the node graph, with progress, bag and analysis."""

from __future__ import annotations

import argparse
import gc
import importlib
import json
import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import exit_codes
from robot_formation.cli.bag_options import add_split, split_bytes, split_ns
from robot_formation.cli.option_types import number, port, seconds, whole_number
from robot_formation.cli.parser import Subparsers
from robot_formation.cli.picture_format import add_format
from robot_formation.errors import FormationError
from robot_formation.json_values import JsonObject
from robot_formation.system.garbage import rare_collections

if TYPE_CHECKING:
    from robot_formation.bag.bag_path import PathReservation
    from robot_formation.experiment.run_result import RunResult
    from robot_formation.experiment.scenario import Scenario

DESCRIPTION = """\
Run a scenario through the node graph (one process per node), record it into a bag and analyse it. Without arguments:
track two of the paper with the project's own predictor, 'formation' ('measured' is the paper's). Progress goes to
standard error, the analysis to standard output.
"""


MOST_WARNINGS = 20


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("run", help="run a scenario, record and analyse it", description=DESCRIPTION)
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--track", metavar="NAME", help="preset track: one, two (default), ... (see 'formation list')")
    what.add_argument("--scenario", metavar="FILE", type=Path, help="file or name, see 'formation list scenarios'")
    parser.add_argument(
        "--predictor",
        metavar="NAME",
        help="formation (default), measured (the paper's), previous, ... (see 'formation list')",
    )
    parser.add_argument("--seed", metavar="N", type=whole_number, help="seed of every random stream")
    parser.add_argument(
        "--path", metavar="NAME", help="the leader's path: straight, circle, ... (see 'formation list')"
    )
    parser.add_argument(
        "--schedule", metavar="NAME", help="who waits for whom: turns (default, the paper's), wave, together or timer"
    )
    parser.add_argument("--surface", metavar="NAME", help="bowl, plane, ... (see 'formation list')")
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="any parameter, like predictor.forgetting=0.95 or followers=2; may be repeated",
    )
    parser.add_argument("--bag", metavar="PATH", type=Path, help="folder of the bag (default: a new one in bags/)")
    parser.add_argument("--images", action="store_true", help="record pictures too (126 MB per thousand)")
    add_split(parser)
    parser.add_argument(
        "--real-time-factor", metavar="X", type=number, help="0: as fast as possible (default), 1: real time"
    )
    parser.add_argument(
        "--camera", metavar="MODE", help="stream (every frame, default) or on_demand (requested frames)"
    )
    parser.add_argument("--view", action="store_true", help="show the run in 3-D in a browser of this machine")
    parser.add_argument("--view-port", metavar="N", type=port, help="port of --view (default: 8080; 0: any free one)")
    parser.add_argument("--in-process", action="store_true", help="the same run in one process, without ROS middleware")
    parser.add_argument(
        "--without",
        metavar="NODE",
        action="append",
        default=[],
        help="don't start this node, but wait for one of its name that you start: block_detector (that of every "
        "follower), follower_2/block_detector, ...; may be repeated",
    )
    parser.add_argument(
        "--stand-in-timeout", metavar="S", type=seconds, help="how long to wait for such nodes (default: 300)"
    )
    add_format(parser)
    parser.add_argument(
        "--json", action="store_true", help="print JSON and nothing else on standard output; no pictures"
    )
    parser.set_defaults(run=run)


@rare_collections()  # imports make objects, and hardly any garbage
def run(args: argparse.Namespace) -> int:
    """Run, analyse, print; return 0 done, 3 lost or off the plate, 4 a node died, 130 interrupted.

    Raises:
        FormationError: on anything wrong in the arguments, before anything is started.
    """
    from robot_formation.experiment.stand_ins import WORLD_NODE
    from robot_formation.extras import require
    from robot_formation.network.shared_memory import TracingFiles
    from robot_formation.network.shared_memory_space import require_space

    tracing = TracingFiles()  # before anything of ROS is loaded
    try:
        import_before_the_users(in_process=args.in_process, own_process=args.own_process)
        scenario = build_scenario(args)
        check_stand_ins(args, scenario)
        require("ros", *(() if WORLD_NODE in args.without else ("sim",)))
        require_space()
        check_view(args)
        with reserve(args, scenario) as place:
            result = execute(args, scenario, place)
    finally:
        tracing.remove_new()
    for warning in result.warnings[:MOST_WARNINGS]:
        print(f"warning: {warning}", file=sys.stderr)
    if len(result.warnings) > MOST_WARNINGS:
        print(f"... and {len(result.warnings) - MOST_WARNINGS} more warnings", file=sys.stderr)
    if result.reason:
        print(f"formation run: {result.reason}", file=sys.stderr)
    try:
        if result.bag is not None:
            report(args, result)
            sys.stdout.flush()
            return result.exit_code
    except BrokenPipeError:
        from robot_formation.cli.interrupts import forget_output

        forget_output()
        return result.exit_code
    except FormationError as error:
        if result.exit_code in (exit_codes.DONE, exit_codes.LOST):
            raise
        # A run that was cut short may have ended before there was anything to analyse.
        print(f"formation run: no analysis: {error}", file=sys.stderr)
    if args.json:
        print(cut_off_json(args, scenario, result))
    elif result.bag is not None:
        print(f"bag: {result.bag}")
    return result.exit_code


def import_before_the_users(*, in_process: bool, own_process: bool) -> None:
    """Import what is large and the package's own, before a class of the user's is loaded.

    In the command's own process collections leave out what is there by then, the one at Python's end above all. What is
    loaded later may be the user's, and is collected.

    Raises:
        FormationError: ROS or the simulator isn't installed, or shared memory is full.
    """
    from robot_formation.extras import require

    importlib.import_module("robot_formation.experiment.scenario")
    if in_process:
        require("ros", "sim")
        importlib.import_module("robot_formation.experiment.in_process")
    if own_process:
        gc.freeze()


def build_scenario(args: argparse.Namespace) -> Scenario:
    """Return the scenario made from preset or file and the options.

    Raises:
        FormationError: naming what is misspelt or out of range.
    """
    from robot_formation.experiment import scenario as scenarios
    from robot_formation.experiment.choices import choose

    file, track = args.scenario, "two" if args.track is None else args.track
    scenario = scenarios.load(file) if file is not None else scenarios.load_track(track)
    scenario = choose(scenario, vars(args), lambda name: f"--{name.replace('_', '-')}")
    scenario = scenarios.override(scenario, args.set)
    scenario.check()
    return scenario


def check_view(args: argparse.Namespace) -> None:
    """Check that the run can be shown, if that is asked for.

    Raises:
        FormationError: it runs in one process, viser is missing, or the port can't be used.
    """
    if args.view:
        if args.in_process:
            raise FormationError(
                "--view shows the node graph; leave --in-process out, or see 'formation view BAG' later"
            )
        from robot_formation.viewing.browser import DEFAULT_PORT, check_viewer

        args.view_port = check_viewer(DEFAULT_PORT if args.view_port is None else args.view_port)


def check_stand_ins(args: argparse.Namespace, scenario: Scenario) -> None:
    """Check which nodes somebody else starts; `without` then has the name of each.

    Raises:
        FormationError: there is no such node, or the run has no nodes at all.
    """
    from robot_formation.experiment.stand_ins import stand_ins_of

    if args.without and args.in_process:
        raise FormationError("--without leaves out a node of the graph, and --in-process has none; give one of them")
    if args.stand_in_timeout is not None and not args.without:
        raise FormationError("--stand-in-timeout is how long to wait for the nodes of --without; give that too")
    args.without = stand_ins_of(scenario, args.without, "--without")


def reserve(args: argparse.Namespace, scenario: Scenario) -> PathReservation:
    """Reserve the bag's path: as asked for, else a new name after the run and the time."""
    from robot_formation.bag.bag_path import PathReservation, reserve_new
    from robot_formation.paths import default_bags_dir

    if args.bag is not None:
        return PathReservation(args.bag)
    stem = f"{scenario.setup.name}_{scenario.predictor.name}_seed{scenario.setup.seed}_{time.strftime('%Y%m%d-%H%M%S')}"
    return reserve_new(default_bags_dir(), re.sub(r"[^\w.-]", "_", stem))


def execute(args: argparse.Namespace, scenario: Scenario, place: PathReservation) -> RunResult:
    """Run the scenario in the way that the options ask for."""
    from robot_formation.bag.write_options import WriteOptions
    from robot_formation.calibration.camera_check import describe_camera
    from robot_formation.calibration.drive_check import describe_curves
    from robot_formation.experiment.overhead_defaults import LARGEST_M

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    say(describe_curves(scenario.drive))
    if camera := describe_camera(scenario.fine_tuner):
        say(camera)
    if scenario.too_large_for_overhead:
        say(f"overhead camera: off, for the plate is larger than {LARGEST_M:g} m; world.overhead.* arranges one")
    options = WriteOptions(split_bytes=split_bytes(args), split_ns=split_ns(args))
    if args.in_process:
        from robot_formation.experiment.in_process import run_in_process
        from robot_formation.experiment.one_process import check_one_process
        from robot_formation.launching.processes import run_metadata

        check_one_process(scenario)
        return run_in_process(
            scenario,
            place.path,
            run_metadata(scenario),
            images=args.images,
            options=options,
            say=say,
            reservation=place,
        )
    from robot_formation.experiment.stand_ins import TIMEOUT_S
    from robot_formation.launching.launcher import Launcher

    return Launcher(
        scenario,
        place.path,
        args.images,
        say,
        options=options,
        reservation=place,
        view_port=args.view_port if args.view else None,
        stand_ins=args.without,
        stand_in_timeout_s=TIMEOUT_S if args.stand_in_timeout is None else args.stand_in_timeout,
    ).run()


def report(args: argparse.Namespace, result: RunResult) -> None:
    """Print the analysis of the run's bag."""
    from robot_formation.analysis.from_bag import load_run
    from robot_formation.analysis.quantities import analyse
    from robot_formation.analysis.report import run_report, text_report, to_json, write_pictures

    assert result.bag is not None  # checked by the caller
    record = load_run(result.bag)
    analysis = analyse(record)
    if args.json:
        said = run_report(record, analysis, in_process=args.in_process, bag=result.bag, reason=result.reason)
        print(to_json(said))
        return
    print(text_report(record, analysis))
    if result.exit_code == exit_codes.INTERRUPTED:  # whoever interrupts wants to leave
        print(f"\nbag: {result.bag}\n'formation analyze {result.bag}' makes the pictures")
        return
    folder = result.bag.with_name(f"{result.bag.name}_analysis")
    pictures = write_pictures(record, analysis, folder, args.format)
    print(f"\nbag: {result.bag}\npictures: " + ", ".join(str(picture) for picture in pictures))


def cut_off_json(args: argparse.Namespace, scenario: Scenario, result: RunResult) -> str:
    """Return the JSON of a run that left nothing to analyse: what it was to be, and why it ended."""
    from robot_formation.analysis.conditions import run_facts
    from robot_formation.analysis.report import ending
    from robot_formation.launching.processes import run_metadata

    facts = run_facts(run_metadata(scenario, args.without), in_process=args.in_process)
    nothing: JsonObject = {
        "scenario": scenario.setup.name,
        "outcome": "incomplete",
        "timesteps": [],
        "totals": None,
    }
    return json.dumps({**nothing, **facts, **ending(result.bag, (), result.reason)}, indent=2)
