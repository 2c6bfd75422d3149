"""formation test: the project's own tests.

What takes long to import is imported where it is needed: each start of the command line reads every verb's file.
"""

from __future__ import annotations

import argparse
import os
import sys

from robot_formation.cli.parser import Parser
from robot_formation.errors import FormationError
from robot_formation.paths import project_root

_MOST_WORKERS = 4  # the tests of the node graph start a dozen processes each


def add_parser(subparsers: argparse._SubParsersAction[Parser]) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser(
        "test",
        help="run the project's tests",
        description="Runs the project's tests with pytest, spread over the cores. Arguments after -- go to pytest "
        "instead, for instance: formation test -- -k predictor -x",
    )
    parser.add_argument("pytest_arguments", nargs="*", metavar="PYTEST_ARGUMENT", help="after --: handed to pytest")
    parser.unknown_hint = "; arguments of pytest come after --, like: formation test -- -k predictor"
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run pytest in the checkout and return its exit code, 130 if interrupted.

    Raises:
        FormationError: if this is no source checkout, or pytest is not installed.
    """
    import importlib.util
    import signal
    import subprocess

    root = project_root()
    if root is None or not (root / "test").is_dir():
        raise FormationError("the tests are part of the source, which this install lacks: run ./formation test there")
    if importlib.util.find_spec("pytest") is None:
        raise FormationError(f"pytest is not installed: pip install -e '{root}[test]'")
    command = [sys.executable, "-m", "pytest", *(args.pytest_arguments or _spread())]
    with subprocess.Popen(command, cwd=root) as process:
        try:
            return process.wait()
        except KeyboardInterrupt:  # pytest has had the signal too, and reports before it ends
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            process.wait()
            return 130


def _spread() -> list[str]:
    """Arguments that spread the tests over the cores, those of one group (xdist_group) on one core."""
    import importlib.util

    workers = min(len(os.sched_getaffinity(0)), _MOST_WORKERS)
    if workers < 2 or importlib.util.find_spec("xdist") is None:
        return []
    return ["-n", str(workers), "--dist", "loadgroup"]
