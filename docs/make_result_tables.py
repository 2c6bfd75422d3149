"""Rewrites the tables of results in the README and on pages from the stored runs in docs/data/.

Each stands between two comments, like <!-- tracks --> and <!-- /tracks -->. How the runs were made is written below
each table; the tests fail when a table isn't what its data say.

Run: python docs/make_result_tables.py [--check]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from marked_text import with_marked
from robot_formation.analysis import markdown
from robot_formation.analysis.sweep_summary import summarise
from robot_formation.errors import FormationError
from robot_formation.experiment.sweep import Row, read_sweep
from robot_formation.json_values import JsonObject

if TYPE_CHECKING:
    import leader_path_runs

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "docs" / "data"
README_PREDICTORS = ("previous", "measured", "previous+close", "formation")


class Table(NamedTuple):
    """A table of a page: the page, its marks' name, and what makes the lines."""

    page: Path
    name: str
    lines: Callable[[], Sequence[str]]


def track_rows() -> list[Row]:
    """Read the stored runs of both tracks."""
    return read_sweep(DATA / "tracks")[1]


def readme_lines() -> list[str]:
    """Return the README's table."""
    heads = (
        "runs",
        "lost",
        "correction distance (cm)",
        "reduction against `previous` (%)",
        "formation error, RMSE (cm)",
    )
    rows = [row for row in track_rows() if row.predictor in README_PREDICTORS]
    return markdown.table(
        ("track", "predictor", *heads), [_track_cells(entry) for entry in ordered(rows, README_PREDICTORS)]
    )


def bowl_lines() -> list[str]:
    """Return the table of the page on predictors, which has moves and the noise floor too."""
    heads = ("runs", "lost", "correction (cm)", "reduction (%)", "formation error, RMSE (cm)", "moves per timestep")
    entries = ordered(track_rows(), (*README_PREDICTORS, "ideal", "ideal+close"))
    moves = [f"{entry['movements_per_timestep']['median']:.2f}" for entry in entries]
    cells = [[*_track_cells(entry), moved] for entry, moved in zip(entries, moves, strict=True)]
    return markdown.table(("track", "predictor", *heads), cells)


def sensitivity_lines() -> list[str]:
    """Return the table of the sensitivity study."""
    import sensitivity
    from run_table import open_table

    rows = list(open_table(DATA / "sensitivity", sensitivity.Row).read())
    count = len({row.seed for row in rows})
    return [*sensitivity.table_lines(rows), "", f"{len(rows)} runs, {count} seeds of each."]


def leader_path_lines(surface: str) -> list[str]:
    """Return the table of one surface's leader paths."""
    import leader_path_tables

    return leader_path_tables.surface_lines(_leader_path_rows(), surface)


def phase_lines() -> list[str]:
    """Return the table of leader paths by phase of the run, on the bowl."""
    import leader_path_tables

    return leader_path_tables.phase_lines(_leader_path_rows(), "bowl")


def _leader_path_rows() -> list[leader_path_runs.Row]:
    import leader_path_runs
    from run_table import open_table

    return list(open_table(DATA / "leader_paths", leader_path_runs.Row).read())


def blackout_lines() -> list[str]:
    """Return the table of blackouts."""
    import blackouts
    from run_table import open_table

    return blackouts.page_lines(list(open_table(DATA / "blackouts", blackouts.Row).read()))


def ordered(rows: Sequence[Row], predictors: Sequence[str]) -> list[JsonObject]:
    """Summarise runs, by track and then in the order of the predictors."""
    return sorted(summarise(rows), key=lambda entry: (entry["track"], predictors.index(entry["predictor"])))


def _track_cells(entry: JsonObject) -> list[str]:
    reduction = "-" if entry["predictor"] == "previous" else markdown.interval(entry["reduction"], 100.0, 0)
    return [
        entry["track"],
        f"`{entry['predictor']}`",
        str(entry["runs"]),
        str(entry["lost"]),
        markdown.interval(entry["correction_m"], 100.0, 1),
        reduction,
        markdown.interval(entry["formation_error_rmse_m"], 100.0, 2),
    ]


PREDICTORS_PAGE = ROOT / "docs" / "explanation" / "predictors_compared.md"
SENSITIVITY_PAGE = ROOT / "docs" / "explanation" / "sensitivity.md"
TABLES = (
    Table(ROOT / "README.md", "tracks", readme_lines),
    Table(PREDICTORS_PAGE, "bowl", bowl_lines),
    Table(PREDICTORS_PAGE, "leader_paths", partial(leader_path_lines, "bowl")),
    Table(PREDICTORS_PAGE, "leader_paths_plane", partial(leader_path_lines, "plane")),
    Table(PREDICTORS_PAGE, "leader_paths_saddle", partial(leader_path_lines, "saddle")),
    Table(PREDICTORS_PAGE, "leader_paths_phases", phase_lines),
    Table(PREDICTORS_PAGE, "blackouts", blackout_lines),
    Table(SENSITIVITY_PAGE, "sensitivity", sensitivity_lines),
)


def updated(table: Table) -> tuple[str, str]:
    """Return a page's text as it is, and as it should be."""
    return with_marked(table.page, table.name, "\n".join(table.lines()))


def main() -> int:
    """Rewrite the tables, or with --check only tell what is out of date (exit code 1; 2: the data can't be read)."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a table is out of date")
    check = parser.parse_args().check
    sys.path.insert(0, str(ROOT / "bench"))
    try:
        stale = rewritten(check=check)
    except FormationError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{'out of date' if check else 'rewritten'}: {', '.join(stale) or 'none'}")
    return 1 if check and stale else 0


def rewritten(*, check: bool) -> list[str]:
    """Rewrite the tables that are out of date, unless they are only checked; return their names."""
    stale = []
    for table in TABLES:
        before, after = updated(table)
        if before != after:
            stale.append(f"{table.page.name}: {table.name}")
            if not check:
                table.page.write_text(after, encoding="utf-8")
    return stale


if __name__ == "__main__":
    sys.exit(main())
