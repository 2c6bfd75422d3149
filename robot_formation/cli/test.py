"""formation test: the project's own tests.

What takes long to import is imported where it is needed: each start of the command line reads every verb's file.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from robot_formation.cli.parser import Parser
from robot_formation.errors import FormationError
from robot_formation.paths import project_root

_MOST_WORKERS = 4  # the tests of the node graph start a dozen processes each
_SLOWEST = 20
_TIMEOUT_S = 600  # for each test; on a busy machine mypy takes minutes
_QUICK = ("-m", "not graph and not slow and not long")
_DEFAULT = ("-m", "not long")


def add_parser(subparsers: argparse._SubParsersAction[Parser]) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser(
        "test",
        help="run the project's tests",
        description="Runs the project's tests with pytest, spread over the cores, and lists the slowest. Arguments "
        "after -- go to pytest too, for instance: formation test -- -k predictor -x. A test that hangs fails after "
        f"{_TIMEOUT_S // 60} minutes.",
    )
    extent = parser.add_mutually_exclusive_group()
    extent.add_argument(
        "--quick",
        action="store_true",
        help="leave out what starts processes or takes long: the linters, the layers and the core's tests remain",
    )
    extent.add_argument(
        "--all", action="store_true", help="leave out nothing; the default leaves out the tests marked long"
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
    arguments = [*_extent(args, root), *args.pytest_arguments]
    command = [sys.executable, "-m", "pytest", f"--durations={_SLOWEST}", *_limits(), *_spread(arguments), *arguments]
    with subprocess.Popen(command, cwd=root) as process:
        try:
            return process.wait()
        except KeyboardInterrupt:  # pytest has had the signal too, and reports before it ends
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            process.wait()
            return 130


def _extent(args: argparse.Namespace, root: Path) -> Sequence[str]:
    """Arguments that say which tests are run; tests whose file is given are run however long they take."""
    if args.quick:
        return _QUICK
    named = any(_is_test_file(root, argument) for argument in args.pytest_arguments)
    return () if args.all or named else _DEFAULT


def _is_test_file(root: Path, argument: str) -> bool:
    """Return whether an argument of pytest names a file of tests, or a test in one; options' values don't count."""
    name = argument.partition("::")[0]
    return name.endswith(".py") and (root / name).is_file()


def _limits() -> list[str]:
    """Arguments that end a test that hangs."""
    import importlib.util

    return [] if importlib.util.find_spec("pytest_timeout") is None else [f"--timeout={_TIMEOUT_S}"]


def _spread(arguments: Sequence[str]) -> list[str]:
    """Arguments that spread the tests over the cores, those of one group (xdist_group) on one core.

    None where the user's own arguments say how, or there is one core.
    """
    import importlib.util

    own = any(argument.startswith("-n") or argument == "no:xdist" for argument in arguments)
    workers = min(len(os.sched_getaffinity(0)), _MOST_WORKERS)
    if own or workers < 2 or importlib.util.find_spec("xdist") is None:
        return []
    return ["-n", str(workers), "--dist", "loadgroup"]
