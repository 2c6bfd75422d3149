"""`formation VERB`: one verb per file, errors as one line, documented exit codes."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

import robot_formation
from robot_formation import exit_codes
from robot_formation.cli.interrupts import flush_or_forget_output, forget_output
from robot_formation.cli.parser import Parser
from robot_formation.cli.verbs import VERBS
from robot_formation.errors import FormationError

EPILOG = """\
exit codes: 0 done, 2 usage or bad input, 3 leader lost or plate left, 4 a node died, 130 interrupted
"""


def make_parser() -> argparse.ArgumentParser:
    """Build the parser of all verbs."""
    parser = Parser(
        prog="formation",
        description="Robot formation on an unmapped curved surface, with Koopman prediction and a Pixy2 camera.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"robot_formation {robot_formation.__version__}")
    subparsers = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    for verb in VERBS:
        verb.add_parser(subparsers)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a verb; return its exit code."""
    parser = make_parser()
    if "_ARGCOMPLETE" in os.environ:  # a shell asks by what `formation completion` has printed
        import argcomplete

        from robot_formation.cli.name_completion import offer_names

        offer_names(parser)
        argcomplete.autocomplete(parser, always_complete_options=False)
    args = parser.parse_args(arguments)
    args.own_process = arguments is None  # other programs that call this function are expected to give arguments
    try:
        code: int = args.run(args)
        sys.stdout.flush()
        return code
    except FormationError as error:
        flush_or_forget_output()
        print(f"formation {args.verb}: {error}", file=sys.stderr)
        return exit_codes.BAD_INPUT
    except KeyboardInterrupt:
        print(f"formation {args.verb}: interrupted", file=sys.stderr)
        return exit_codes.INTERRUPTED
    except BrokenPipeError:
        forget_output()
        return exit_codes.DONE
    except OSError as error:
        flush_or_forget_output()
        print(f"formation {args.verb}: {error.filename or 'output'}: {error.strerror or error}", file=sys.stderr)
        return exit_codes.BAD_INPUT
