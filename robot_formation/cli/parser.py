"""The command line's parser: what is misspelt is named, with what was probably meant and the usage of its own verb."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from robot_formation import exit_codes
from robot_formation.cli.interrupts import forget_output
from robot_formation.cli.option_types import quoted
from robot_formation.parameters import suggestion


class Parser(argparse.ArgumentParser):
    """A parser for a program and, since argparse makes subparsers of the same class, for its verbs.

    Attributes:
        unknown_hint: told after an option that there isn't.
    """

    unknown_hint = ""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Make a parser as argparse does, but one that refuses empty paths: they would be the current folder."""
        super().__init__(*args, **kwargs)
        self.register("type", Path, _path)

    def error(self, message: str) -> NoReturn:
        """Print usage and message, end with exit code 2."""
        super().error(message.replace("ignored explicit argument", "takes no value, not"))

    def exit(self, status: int = 0, message: str | None = None) -> NoReturn:
        """End the process; help that can't be written is said in one line, and the exit code is 2."""
        try:
            sys.stdout.flush()
        except OSError as error:
            forget_output()
            if not isinstance(error, BrokenPipeError):
                status, message = exit_codes.BAD_INPUT, f"{self.prog}: output: {error.strerror or error}\n"
        super().exit(status, message)

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse as argparse does, but leave nothing over: what can't be used is an error of this very parser.

        Without any argument, a parser that waits for a verb prints its help and ends with exit code 0.
        """
        if "_ARGCOMPLETE" in os.environ:  # words that a shell wants completed: they need not make sense yet
            return super().parse_known_args(args, namespace)
        words = sys.argv[1:] if args is None else list(args)
        if self._subparsers is not None and not words:
            self.print_help()
            self.exit()
        self._refuse_unknown_options(words)
        found, left = super().parse_known_args(words, namespace)
        if left:
            self.error(self._not_taken(left[0]))
        return found, left

    def _refuse_unknown_options(self, words: Sequence[str]) -> None:
        """Report a misspelt option before argparse misses an argument that it would have brought."""
        options = list(_options(words, until_verb=self._subparsers is not None))
        if {"-h", "--help"} & set(options):
            return
        for option in options:
            if not self._knows(option):
                self.error(f"no option {quoted(option)}{self.unknown_hint or self._suggestion(option)}")

    def _knows(self, option: str) -> bool:
        known = self._option_string_actions
        if option.startswith("--"):
            return any(name.startswith(option) for name in known)  # argparse takes abbreviations
        return option in known or option[:2] in known  # the rest may be the value: -oFILE

    def _suggestion(self, option: str) -> str:
        said = suggestion(option, self._option_string_actions)
        return said if "did you mean" in said else f"; '{self.prog} --help' lists them"

    def _not_taken(self, word: str) -> str:
        """Explain an argument that is one too many."""
        option = f"--{word.partition('=')[0]}"
        if option in self._option_string_actions:
            return f"{quoted(word)} is one argument too many{suggestion(option, [option])}"
        return f"{quoted(word)} is one argument too many{self.unknown_hint}; '{self.prog} --help' tells what it takes"

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        choices = [str(choice) for choice in action.choices]
        if value == "help" and self._subparsers is not None:
            hint = f"; did you mean '{self.prog} --help'?"
        elif isinstance(value, str):
            hint = suggestion(value, choices)
        else:
            hint = f"; there are: {', '.join(choices)}"
        if action.option_strings:
            raise argparse.ArgumentError(action, f"can't be {quoted(str(value))}{hint}")
        what = "verb " if action.metavar == "VERB" else ""
        raise argparse.ArgumentError(None, f"no {what}{quoted(str(value))}{hint}")


def _options(words: Sequence[str], *, until_verb: bool) -> Iterator[str]:
    """Yield what argparse takes for options, without their values: neither numbers nor texts with spaces."""
    for word in words:
        if word == "--":
            return
        if word.startswith("-") and word != "-" and " " not in word and not _is_number(word):
            yield word.partition("=")[0]
        elif until_verb:
            return


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _path(text: str) -> Path:
    if not text.strip():
        raise argparse.ArgumentTypeError(f"{text!r} is no path")
    return Path(text)


Subparsers: TypeAlias = "argparse._SubParsersAction[Any]"
"""What argparse returns for adding verbs."""
