"""What the table of `chain.py` says: errors along the chain, string stability, times; as Markdown and as a figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.string_stability import geometric_mean

LATE = 10
"""First timestep of the errors that are told apart from the start's."""


class Task(NamedTuple):
    """One run."""

    ground: str
    path: str
    schedule: str
    followers: int
    seed: int


@dataclass(frozen=True)
class Row:
    """A follower's part of a run; None where unavailable.

    `gains` are from the robot before, by axis and period in timesteps, like 'v10.0=1.05 v5.0=1.2'.
    """

    ground: str
    path: str
    schedule: str
    followers: int
    seed: int
    follower: int
    outcome: str
    timesteps: int
    formation_error_rmse_m: float | None
    formation_error_late_rmse_m: float | None
    formation_error_max_m: float | None
    formation_error_moving_max_m: float | None
    leader_error_rmse_m: float | None
    error_ratio_l2: float | None
    error_ratio_linf: float | None
    gains: str
    gap_min_m: float | None
    touches: int | None
    losses: int
    movements_per_timestep: float | None
    simulated_s: float
    step_s: float
    """Simulated seconds per timestep from the end of the first to that of the last: without the first alignment."""
    cpu_s: float
    wall_s: float

    @property
    def task(self) -> Task:
        """The run that it is of."""
        return Task(self.ground, self.path, self.schedule, self.followers, self.seed)


Run = list[Row]


class Case(NamedTuple):
    """Runs that differ by their seed only."""

    ground: str
    path: str
    schedule: str
    followers: int

    @property
    def name(self) -> str:
        """Cells of a table's first columns."""
        return f"{self.ground} | {self.path} | {self.schedule} | {self.followers}"


def cases_of(rows: Iterable[Row]) -> dict[Case, list[Run]]:
    """Sort rows by case and run, each run's by follower."""
    runs: dict[Task, Run] = {}
    for row in rows:
        runs.setdefault(row.task, []).append(row)
    found: dict[Case, list[Run]] = {}
    for task, run in sorted(runs.items()):
        found.setdefault(Case(*task[:4]), []).append(sorted(run, key=lambda row: row.follower))
    return found


def done(runs: Sequence[Run]) -> list[Run]:
    """Those that came to their end."""
    return [run for run in runs if run[0].outcome == "done"]


def medians(runs: Sequence[Run], name: str) -> list[float]:
    """Median over the runs that came to their end of each follower's value, the first follower first."""
    ended = done(runs)
    columns = zip(*([getattr(row, name) for row in run] for run in ended), strict=True)
    return [float(np.median([math.nan if value is None else value for value in column])) for column in columns]


def cells(values: Sequence[float], scale: float = 1.0, digits: int = 2) -> str:
    """Write the first, the middle and the last value."""
    chosen = sorted({0, (len(values) - 1) // 2, len(values) - 1}) if values else []
    return ", ".join(f"{scale * values[number]:.{digits}f}" for number in chosen) or "-"


def per_robot(runs: Sequence[Run], name: str) -> str:
    """Geometric mean of the ratio per robot, with its 95 % interval over runs, each one by the mean of its hops."""
    means = []
    for run in done(runs):
        ratios = [getattr(row, name) for row in run[1:]]
        if ratios and all(ratios):
            means.append(math.exp(float(np.mean(np.log(ratios)))))
    if not means:
        return "-"
    found = geometric_mean(means)
    if len(means) == 1:
        return f"{found.mean:.2f}"
    return f"{found.mean:.2f} ({found.low:.2f}..{found.high:.2f}){' unstable' if found.above_one else ''}"


def to_other(runs: Sequence[Run], others: Sequence[Run] | None, name: str) -> str:
    """Largest ratio of a follower's median to that of a single follower or of another schedule's same follower."""
    if not others or not done(runs) or not done(others):
        return "-"
    own, theirs = medians(runs, name), medians(others, name)
    ratios = [value / theirs[min(number, len(theirs) - 1)] for number, value in enumerate(own)]
    return f"{max(ratios):.2f}"


def worst(runs: Sequence[Run], name: str, pick: Callable[..., float]) -> float:
    """Largest or smallest value of all runs and followers, also of those that did not come to their end; NaN: none."""
    values = [value for run in runs for row in run if (value := getattr(row, name)) is not None]
    return float(pick(values)) if values else math.nan


def _per_timestep(runs: Sequence[Run], name: str) -> str:
    return _median([getattr(run[0], name) / run[0].timesteps for run in done(runs)])


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f}" if values else "-"


def _table(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *(f"| {' | '.join(line)} |" for line in lines), ""]


NAMED = ("ground", "path", "schedule", "N")


def errors_table(cases: dict[Case, list[Run]]) -> list[str]:
    """Formation errors of follower 1, the middle one and N; their largest; touches and smallest gap."""
    heads = (*NAMED, "runs", "not done", "with touches", "RMSE, cm", f"RMSE from timestep {LATE}, cm",
             "to a single one", "to turns", "max, cm", "max in motion, cm", "least gap, cm")  # fmt: skip
    lines = []
    for case, runs in cases.items():
        single = cases.get(case._replace(followers=1)) if case.followers > 1 else None
        turns = cases.get(case._replace(schedule="turns")) if case.schedule != "turns" else None
        touched = sum(any(row.touches for row in run) for run in runs)
        lines.append(
            [
                case.name,
                *(str(count) for count in (len(runs), len(runs) - len(done(runs)), touched)),
                cells(medians(runs, "formation_error_rmse_m"), 100.0),
                cells(medians(runs, "formation_error_late_rmse_m"), 100.0),
                to_other(runs, single, "formation_error_rmse_m"),
                to_other(runs, turns, "formation_error_late_rmse_m"),
                f"{100.0 * worst(runs, 'formation_error_max_m', max):.1f}",
                f"{100.0 * worst(runs, 'formation_error_moving_max_m', max):.1f}",
                f"{100.0 * worst(runs, 'gap_min_m', min):.1f}",
            ]
        )
    return _table(heads, lines)


def stability_table(cases: dict[Case, list[Run]]) -> list[str]:
    """Ratios from one follower to the next, and errors against the leader."""
    heads = (*NAMED, "runs", "ratio of RMSE per robot", "ratio of maxima per robot", "error to the leader, cm")
    lines = [
        [
            case.name,
            str(len(done(runs))),
            per_robot(runs, "error_ratio_l2"),
            per_robot(runs, "error_ratio_linf"),
            cells(medians(runs, "leader_error_rmse_m"), 100.0),
        ]
        for case, runs in cases.items()
        if case.followers > 1
    ]
    return _table(heads, lines)


def gains_table(cases: dict[Case, list[Run]]) -> list[str]:
    """Gains by frequency, geometric mean over hops and runs, beside persistence's; also of runs that ended early."""
    lines = []
    for case, runs in cases.items():
        by_frequency: dict[tuple[str, float], list[list[float]]] = {}
        for run in runs:
            told = [dict(part.split("=") for part in row.gains.split()) for row in run]
            for key in told[0]:
                of_hops = [float(gains[key]) for gains in told if key in gains]
                by_frequency.setdefault((key[0], float(key[1:])), []).append(of_hops)
        for (axis, period), found in sorted(by_frequency.items(), key=lambda item: (item[0][0], -item[0][1])):
            first = geometric_mean([hops[0] for hops in found]).mean
            later = [math.exp(float(np.mean(np.log(hops[1:])))) for hops in found if len(hops) > 1]
            theory = f"{persistence_gain(2.0 * math.pi / period):.2f}"
            per_hop = f"{geometric_mean(later).mean:.2f}" if later else "-"
            lines.append([case.name, axis, f"{period:.1f}", str(len(found)), f"{first:.2f}", per_hop, theory])
    heads = (*NAMED, "axis", "period", "runs", "leader to 1", "per robot, from 1 on", "persistence")
    return _table(heads, lines)


def times_table(cases: dict[Case, list[Run]]) -> list[str]:
    """Times per timestep, with the first alignment where nothing else is said, and movements and losses."""
    heads = (*NAMED, "simulated s", "without the first alignment", "processor s", "wall s", "moves", "losses per run")
    lines = []
    for case, runs in cases.items():
        ended = [row for run in done(runs) for row in run]
        moves = [row.movements_per_timestep for row in ended if row.movements_per_timestep is not None]
        losses = float(np.mean([sum(row.losses for row in run) for run in runs]))
        lines.append(
            [
                case.name,
                _per_timestep(runs, "simulated_s"),
                _median([run[0].step_s for run in done(runs)]),
                *(_per_timestep(runs, name) for name in ("cpu_s", "wall_s")),
                f"{np.mean(moves):.2f}" if moves else "-",
                f"{losses:.1f}",
            ]
        )
    return _table(heads, lines)


def persistence_gain(theta: float) -> float:
    """Gain of a robot that repeats its neighbour's last displacement and closes the rest, all moving at once."""
    return math.sqrt(5.0 - 4.0 * math.cos(theta))


def persistence_growth(followers: int) -> list[float]:
    """Error of each follower relative to the first, if every robot's moves have independent white errors.

    e_i = -(1 - q) W_(i-1) + n_i with W_i = T W_(i-1) + n_i and |T|^2 = 5 - 4 cos(theta), q one timestep of delay.
    """
    theta = np.linspace(0.0, math.pi, 20001)
    change, gain = 2.0 - 2.0 * np.cos(theta), 5.0 - 4.0 * np.cos(theta)
    parts = [float(np.mean(change * gain**number)) for number in range(followers)]
    errors = np.sqrt(1.0 + np.cumsum(parts))
    return [float(error) for error in errors / errors[0]]


STYLE = {
    "turns": ("#000000", "o"),
    "wave": ("#009E73", "s"),
    "together": ("#E69F00", "^"),
    "timer": ("#D55E00", "v"),
    "timer+delayed": ("#0072B2", "D"),
    "together+delayed": ("#CC79A7", "P"),
}
"""Colour and marker of each schedule and spacing, colours of Okabe and Ito."""


def draw(cases: dict[Case, list[Run]], ground: str, path: str, out: Path) -> Path:
    """Draw the errors along the longest chain of each schedule, and the time per timestep over N.

    Raises:
        AnalysisError: the file can't be written.
    """
    chosen = {case: runs for case, runs in cases.items() if (case.ground, case.path) == (ground, path) and done(runs)}
    figure = new_figure(10.0, 4.6)
    left, right = figure.subplots(1, 2)
    _draw_errors(left, chosen)
    _draw_times(right, chosen)
    handles = {handle.get_label(): handle for axes in (right, left) for handle in axes.get_legend_handles_labels()[0]}
    legend_below(figure, list(handles.values()), 4, fontsize=9)
    return save_figure(figure, out)


def _draw_errors(axes: Any, cases: dict[Case, list[Run]]) -> None:
    most = 0.0
    for schedule, (colour, marker) in STYLE.items():
        counts = [case.followers for case in cases if case.schedule == schedule]
        if not counts or max(counts) < 2:
            continue
        longest = next(case for case in cases if (case.schedule, case.followers) == (schedule, max(counts)))
        errors = 100.0 * np.array(medians(cases[longest], "formation_error_rmse_m"))
        numbers = np.arange(1, len(errors) + 1)
        # Turns and wave end timesteps in the same places: the wider line shows below the other one.
        wide = {"linewidth": 5, "markersize": 8} if schedule == "turns" else {"markersize": 4}
        axes.plot(numbers, errors, color=colour, marker=marker, label=schedule, **wide)
        most = max(most, float(errors.max()))
        if schedule == "timer":
            growth = errors[0] * np.array(persistence_growth(len(errors)))
            axes.plot(numbers, growth, color=colour, linestyle=":", label="timer, theory of persistence")
    axes.set_yscale("log")
    axes.set_yticks([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0])
    axes.set_ylim(0.1, 4.0 * max(most, 1.0))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.set_xticks(range(1, 11))
    axes.set(xlabel="follower", ylabel="formation error, RMS (cm)", title="Error along the chain")
    axes.grid(which="both", alpha=0.3)


def _draw_times(axes: Any, cases: dict[Case, list[Run]]) -> None:
    for schedule, (colour, marker) in STYLE.items():
        points = {
            case.followers: float(np.median([run[0].simulated_s / run[0].timesteps for run in done(runs)]))
            for case, runs in cases.items()
            if case.schedule == schedule
        }
        if not points:
            continue
        numbers, times = np.array(list(points)), np.array(list(points.values()))
        axes.plot(numbers, times, color=colour, marker=marker, markersize=4, linestyle="none", label=schedule)
        if len(points) < 2:
            continue
        ends = np.array([numbers.min(), numbers.max()])
        if schedule == "turns":
            axes.plot(
                ends, np.polyval(np.polyfit(numbers, times, 1), ends), color=colour, linestyle="--", label="linear"
            )
        elif schedule == "timer":
            axes.plot([1, 10], [times.mean()] * 2, color=colour, linestyle="--", label="constant")
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.5, 10.5)
    axes.set_xticks(range(1, 11))
    axes.set(xlabel="followers", ylabel="simulated time per timestep (s)", title="Time per timestep")
    axes.grid(alpha=0.3)
