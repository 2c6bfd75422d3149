"""A measured figure beside a peer's or a limit, both of the same run; what `bench/all.py` collects of each bench."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Comparison:
    """One figure of a bench and what it is compared with.

    Attributes:
        what: is measured.
        ours: the figure.
        other: the peer's figure in the same run, or the limit.
        unit: of both.
        beside: the peer's name, or "limit".
        larger_is_better: whether the ratio is ours / other, or other / ours.
    """

    what: str
    ours: float
    other: float
    unit: str
    beside: str = "limit"
    larger_is_better: bool = False

    @property
    def ratio(self) -> float:
        """How much better ours is: above 1 it is better than the peer, or keeps the limit."""
        better, worse = (self.ours, self.other) if self.larger_is_better else (self.other, self.ours)
        return better / worse if worse else float("inf")


def add_comparisons(parser: argparse.ArgumentParser) -> None:
    """Add the option by which `bench/all.py` asks a bench for its comparisons."""
    parser.add_argument("--comparisons", action="store_true", help="print what is compared as JSON, for bench/all.py")


def as_json(found: Iterable[Comparison]) -> str:
    """Return comparisons as JSON."""
    return json.dumps([asdict(comparison) for comparison in found], indent=1)


def from_json(text: str) -> list[Comparison]:
    """Return the comparisons that a bench has printed.

    Raises:
        ValueError: if the text is none of them.
    """
    try:
        return [Comparison(**entry) for entry in json.loads(text)]
    except (TypeError, ValueError) as error:
        raise ValueError(f"no comparisons: {error}") from None


def markdown(found: Iterable[tuple[str, Comparison]]) -> list[str]:
    """Return the lines of a table: bench, figure, what it is compared with, ratio."""
    lines = ["| bench | what | ours | compared with | ratio |", "|---|---|---|---|---|"]
    for bench, c in found:
        beside = f"{c.beside}: {c.other:.4g} {c.unit}".rstrip()
        ours = f"{c.ours:.4g} {c.unit}".rstrip()
        lines.append(f"| `{bench}` | {c.what} | {ours} | {beside} | {c.ratio:.2f} |")
    return lines
