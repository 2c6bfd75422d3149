"""Tables in Markdown, and their cells of medians with intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    first, *others = (f"| {' | '.join(row)} |" for row in (heads, *rows))
    return [first, "|---" * len(heads) + "|", *others]


def interval(value: Mapping[str, float | None] | None, scale: float = 1.0, digits: int = 1) -> str:
    """Return a cell: the median, and its interval in brackets; "lost" where a number is None, "-" without any.

    Args:
        value: as of `sweep_summary.median_with_interval`.
        scale: factor on the numbers.
        digits: behind the point.
    """
    if value is None:
        return "-"
    numbers = (value[name] for name in ("median", "low", "high"))
    # Adding zero makes no -0 of what rounds to it.
    middle, low, high = ("lost" if n is None else f"{round(scale * n, digits) + 0.0:.{digits}f}" for n in numbers)
    return f"{middle} ({low}..{high})"
