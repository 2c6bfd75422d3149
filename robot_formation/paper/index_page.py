"""The page that sets our figures beside what the paper states: one file, readable on a phone."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from robot_formation.analysis.sweep_summary import summarise
from robot_formation.experiment.sweep import Row
from robot_formation.paper.comparison import Comparison, Ours, reduction
from robot_formation.paper.statements import FIGURES, PaperFigure
from robot_formation.reporting.citation import ARXIV

_TYPES = {".png": "image/png", ".svg": "image/svg+xml"}
_WORDS = {True: "agrees", False: "differs", None: "unknown"}
_STYLE = """
body { font-family: system-ui, sans-serif; line-height: 1.4; margin: 0 auto; max-width: 60rem; padding: 0 1rem 2rem;
  color: #1a1a1a; background: #fff; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; border-top: 1px solid #ccc; padding-top: 1rem; }
img { max-width: 100%; height: auto; }
.wide, .figure { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 0.9rem; }
th, td { text-align: left; vertical-align: top; padding: 0.25rem 0.6rem 0.25rem 0; border-bottom: 1px solid #ddd; }
td.number { white-space: nowrap; }
.agrees { color: #00694b; } .differs { color: #a33f00; font-weight: 600; } .unknown { color: #555; }
small { color: #555; }
@media (max-width: 34rem) {
  .figure img { max-width: none; width: 44rem; }
  .numbers thead { display: none; }
  .numbers tr { display: block; border-bottom: 1px solid #999; padding: 0.4rem 0; }
  .numbers td { display: block; border: 0; padding: 0; white-space: normal; }
  .numbers td[data-name]::before { content: attr(data-name) ": "; color: #555; }
}
"""


def write_page(
    pictures: Mapping[str, Path],
    compared: Mapping[str, Sequence[Comparison]],
    rows: Sequence[Row],
    facts: Sequence[str],
    path: Path,
) -> Path:
    """Write the page; pictures lie in it, those of a format that browsers don't show are linked.

    Args:
        pictures: by name of figure.
        compared: numbers by name of figure.
        rows: the runs over seeds.
        facts: paragraphs on how everything was measured.
        path: of the page.
    """
    said = [number for numbers in compared.values() for number in numbers]
    counts = {word: sum(_WORDS[number.agrees] == word for number in said) for word in _WORDS.values()}
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>The paper's figures from our own runs</title><style>{_STYLE}</style></head><body>",
        "<h1>The paper's figures from our own runs</h1>",
        f'<p>Wang, Baba, Hikihara: "Robot formation control in nonlinear manifold using Koopman operator theory" '
        f'(<a href="{ARXIV}">arXiv:2205.04052</a>). Each figure is drawn from simulated robots; below it every number '
        "that the paper's text states for it, ours, and the difference. What only the paper's pictures show can't be "
        "compared: they are not in its source.</p>",
        f"<p><strong>{len(said)} numbers: {counts['agrees']} agree, {counts['differs']} differ"
        + (f", {counts['unknown']} unknown" if counts["unknown"] else "")
        + ".</strong></p>",
        *(f"<p>{escape(fact)}</p>" for fact in facts),
    ]
    for number, figure in enumerate(FIGURES, 1):
        parts += _section(number, figure, pictures[figure.name], compared[figure.name])
        if figure.name == "corrections":
            parts.append(_runs(rows))
    parts.append("</body></html>")
    path.write_text("\n".join(parts) + "\n", encoding="utf-8")
    return path


def _section(number: int, figure: PaperFigure, picture: Path, compared: Sequence[Comparison]) -> list[str]:
    kind = _TYPES.get(picture.suffix)
    shown = f'<a href="{escape(picture.name)}">{escape(picture.name)}</a>'
    if kind is not None:
        data = base64.b64encode(picture.read_bytes()).decode("ascii")
        shown = f'<div class="figure"><img src="data:{kind};base64,{data}" alt="{escape(figure.title)}"></div>'
    rows = "\n".join(_row(entry) for entry in compared)
    return [
        f'<h2 id="{figure.name}">{number}. {escape(figure.title)}</h2>',
        f"<p><small>In the paper: {escape(figure.label)}</small></p>",
        shown,
        '<table class="numbers"><thead><tr><th>number</th><th>paper</th><th>ours</th><th>difference</th>'
        f"<th></th></tr></thead><tbody>{rows}</tbody></table>",
    ]


def _row(entry: Comparison) -> str:
    stated, ours = entry.statement, entry.ours
    word = _WORDS[entry.agrees]
    told = [f"<small>{escape(stated.where)}</small>"]
    told += [f"<small>{escape(ours.note)}</small>"] if ours.note else []
    told += [f"<small>Why: {escape(ours.reason)}</small>"] if entry.agrees is not True and ours.reason else []
    bound = "below " if ours.below else ""
    difference = "-" if entry.difference is None else number_text(entry.difference, stated.unit, sign="+")
    cells = (
        ("paper", bound + number_text(stated.value, stated.unit)),
        ("ours", ours_text(ours, stated.unit)),
        ("difference", difference),
    )
    numbers = "".join(f'<td class="number" data-name="{name}">{escape(text)}</td>' for name, text in cells)
    return f'<tr><td>{escape(stated.says)}<br>{"<br>".join(told)}</td>{numbers}<td class="{word}">{word}</td></tr>'


def number_text(value: float, unit: str, sign: str = "") -> str:
    """Return a number as people read it, with its unit."""
    rounded = 0.0 if abs(value) < 5e-4 else value
    sign = sign if rounded else ""
    digits = 0 if float(rounded).is_integer() else (1 if abs(rounded) >= 10.0 else 2)
    return f"{rounded:{sign}.{digits}f}" + (f" {unit}" if unit else "")


def ours_text(ours: Ours, unit: str) -> str:
    """Return our value with its 95 % interval, where it has one."""
    if ours.value is None:
        return "unknown"
    if ours.low is None or ours.high is None:
        return number_text(ours.value, unit)
    return f"{number_text(ours.value, unit)} ({number_text(ours.low, '')} to {number_text(ours.high, '')})"


def _runs(rows: Sequence[Row]) -> str:
    """Return the table of all runs over seeds."""
    lines = []
    for entry in summarise(rows):
        own = {"one_baseline": "one, own start", "two_baseline": "two, own start"}.get(entry["track"], entry["track"])
        base = reduction(rows, entry["track"], entry["track"], entry["predictor"])
        gain = "-" if entry["predictor"] == "previous" else ours_text(base, "%")
        cells = (own, entry["predictor"], entry["runs"], entry["lost"], _cm(entry["correction_m"]), gain)
        lines.append("<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells) + "</tr>")
    heads = ("track", "predictor", "runs", "lost", "correction from timestep 4 on (cm)", "less than 'previous'")
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    return (
        "<p>Medians over seeds with 95 % bootstrap intervals:</p>"
        f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'
    )


def _cm(found: Mapping[str, float | None] | None) -> str:
    if found is None:
        return "-"
    middle, low, high = (
        "lost" if found[name] is None else f"{100.0 * (found[name] or 0.0):.1f}" for name in ("median", "low", "high")
    )
    return f"{middle} ({low} to {high})"
