"""Visual alignment from all over the calibration grid: both modes of the fine-tuner, by ground truth.

Finds the starts of the grid (position and angle) from where a block of the marker is seen, aligns from a stratified
seeded sample of them in each mode, and prints one table. The table of runs grows in OUT; the same command goes on.

Run: python bench/alignment.py [--starts N] [--modes precise,paper] [--seed N] [--jobs N] [--out FILE] [--set KEY=VALUE]
"""

import argparse
import math
import os
import sys
from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from alignment_grid import (
    equipment,
    faces_seen,
    run_start,
    starts,
    stratified,
    summarise,
    table,
)
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.progress_line import with_progress
from robot_formation.calibration.alignment_trial import Start
from robot_formation.errors import FormationError

LINES: tuple[tuple[str, Callable[[dict[str, Any]], str]], ...] = (
    ("good: u, v, heading within 1.5 cm, 1 cm, 6 deg, untouched, at most 14 moves", lambda s: f"{s['good']:.1%}"),
    ("says aligned", lambda s: f"{s['aligned']:.1%}"),
    ("lost", lambda s: f"{s['lost']:.1%}"),
    ("touched the neighbour", lambda s: f"{s['touched']:.1%}"),
    ("at most 14 moves", lambda s: f"{s['within_moves']:.1%}"),
    ("moves, axes counted apart", lambda s: _pair(s["moves"], 1.0, 0)),
    ("path, m", lambda s: _pair(s["path_m"], 1.0, 2)),
    ("final error along u, mm", lambda s: _pair(s["error_u_m"], 1e3, 1)),
    ("final error along v, mm", lambda s: _pair(s["error_v_m"], 1e3, 1)),
    ("final error in heading, deg", lambda s: _pair(s["error_heading_rad"], math.degrees(1.0), 1)),
)


def _pair(values: Mapping[str, float], scale: float, digits: int) -> str:
    return f"{values['median'] * scale:.{digits}f} / {values['p95'] * scale:.{digits}f}"


def attainable(jobs: int) -> dict[Start, str]:
    made, grid = equipment("precise"), list(starts())
    found = run_parallel(faces_seen, ((made, start) for start in grid), jobs)
    return {start: faces for start, faces in zip(grid, found, strict=True) if faces}


def run(args: Namespace) -> None:
    modes = args.modes.split(",")
    made = {mode: equipment(mode, args.set) for mode in modes}
    faces = attainable(args.jobs)
    print(f"{len(faces)} starts of the grid can be attained", file=sys.stderr)
    results = table(args.out)
    rows = list(results.read()) if args.out.exists() else []
    results.rewrite(rows)
    done = {(row.mode, row.seed) for row in rows}
    sample = stratified(faces, args.starts, args.seed)
    tasks = [(mode, start, seed) for start, seed in sample for mode in modes if (mode, seed) not in done]
    arguments = ((made[mode], mode, start, faces[start], seed) for mode, start, seed in tasks)
    for row in with_progress(run_parallel(run_start, arguments, args.jobs), len(tasks)):
        rows.append(row)
        results.append([row])
    seeds = {seed for _, seed in sample}
    summaries = [summarise([r for r in rows if r.mode == m and r.seed in seeds]) for m in modes]
    print(f"{len(faces)} starts can be attained, {args.starts} alignments in each mode; median / 95 % point\n")
    print("| | " + " | ".join(modes) + " |\n|---|" + "---|" * len(modes))
    for name, cell in LINES:
        print(f"| {name} | " + " | ".join(cell(summary) for summary in summaries) + " |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--modes", default="precise,paper")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("bags/alignment.csv"))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    args = parser.parse_args()
    try:
        run(args)
    except FormationError as error:
        sys.exit(f"alignment: {error}")


if __name__ == "__main__":
    main()
