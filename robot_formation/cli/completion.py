"""`formation completion`: what a shell needs to complete verbs, options and their values."""

from __future__ import annotations

import argparse

from robot_formation.cli.parser import Subparsers

SHELLS = ("bash", "zsh", "fish")
DESCRIPTION = """\
Print what completes 'formation' at the press of Tab: verbs, options, their values where there is a list of them, else
file names. For bash, in ~/.bashrc: eval "$(formation completion bash)"; for zsh, in ~/.zshrc after compinit:
eval "$(formation completion zsh)"; for fish, in ~/.config/fish/config.fish: formation completion fish | source.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("completion", help="completion for bash, zsh or fish", description=DESCRIPTION)
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the shell's code; return 0."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["formation"], shell=args.shell))
    return 0
