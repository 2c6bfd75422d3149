"""What options take: types for argparse, which turns their errors into one line."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

T = TypeVar("T")


def option_type(convert: Callable[[str], T], accepts: Callable[[T], bool], what: str) -> Callable[[str], T]:
    """Make an argparse type.

    Args:
        convert: makes the value of a text, or raises ValueError.
        accepts: whether a value may be given.
        what: what a value is, for the refusal.
    """

    def parse(text: str) -> T:
        try:
            value = convert(text)
        except ValueError:
            pass
        else:
            if accepts(value):
                return value
        raise argparse.ArgumentTypeError(f"{quoted(text)} is not {what}")

    return parse


whole_number = option_type(int, lambda value: True, "a whole number")
number = option_type(float, math.isfinite, "a number")
positive_whole = option_type(int, lambda value: value >= 1, "a whole number above zero")
port = option_type(int, lambda value: 0 <= value <= 65535, "a port, 0 to 65535")
positive = option_type(float, lambda value: 0.0 < value < 1e9, "a number above 0")
seconds = option_type(float, lambda value: 0.0 < value <= 86400.0, "a number of seconds, above 0, a day at most")


def whole_numbers(count: int) -> Callable[[str], tuple[int, ...]]:
    """Make an argparse type for a fixed count of whole numbers, separated by commas."""
    what = f"{count} whole numbers separated by commas"
    return option_type(lambda text: tuple(map(int, text.split(","))), lambda values: len(values) == count, what)


def quoted(text: str) -> str:
    """Quote what was given, the beginning of a long text."""
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


class Names(argparse.Action):
    """Names separated by commas; an option that is repeated adds to them, and each name counts once.

    The value is a tuple of texts in the order given; the default is one too.
    """

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        """Add what was given."""
        names = [name.strip() for name in str(values).split(",")]
        if not all(names):
            raise argparse.ArgumentError(self, f"takes one or several, separated by commas, not {quoted(str(values))}")
        before = getattr(namespace, self.dest)
        earlier = () if before is self.default else before  # the default goes when names are given
        setattr(namespace, self.dest, tuple(dict.fromkeys([*earlier, *names])))
