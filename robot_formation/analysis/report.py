"""A run's analysis as text for the terminal, as strict JSON, and as pictures in a folder."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

from robot_formation.analysis.conditions import conditions_text, run_facts
from robot_formation.analysis.eigenvalue_figure import draw_eigenvalues
from robot_formation.analysis.error_figure import draw_formation_error
from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.figures import draw_corrections, draw_trajectory
from robot_formation.analysis.quantities import FollowerAnalysis, RunAnalysis, Timestep
from robot_formation.analysis.run_record import RunRecord
from robot_formation.bag.folder import bag_name
from robot_formation.geometry.se2 import Motion
from robot_formation.json_values import JsonObject
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS

_HEADERS = (
    ("", "predicted", "moved", "correction", "residual", "moves", "formation", "heading"),
    ("t", "u      v", "u      v", "u      v", "u      v", "", "error", "error"),
    ("", "cm", "cm", "cm", "cm", "", "cm", "deg"),
)
_WIDTHS = (3, 13, 13, 13, 13, 6, 10, 8)
_NONE = "-"


def to_json(said: JsonObject) -> str:
    """Return what is said of a run as the command line prints it, without NaN."""
    return json.dumps(said, indent=2, allow_nan=False)


def run_report(
    record: RunRecord,
    analysis: RunAnalysis,
    *,
    in_process: bool | None = None,
    bag: str | Path | None = None,
    pictures: Sequence[Path] = (),
    reason: str = "",
) -> JsonObject:
    """Return what the command line's JSON says of a run.

    Args:
        record: the run.
        analysis: the same run's quantities.
        in_process: whether it ran in one process; None: unknown.
        bag: where it is recorded.
        pictures: that were drawn of it.
        reason: why it ended before its end.
    """
    facts = run_facts(record.details, in_process=in_process)
    return {**analysis.to_json(), **facts, **ending(bag, pictures, reason)}


def ending(bag: str | Path | None, pictures: Sequence[Path], reason: str) -> JsonObject:
    """List what a run's JSON says of its files, and why it ended before its end."""
    return {
        "bag": None if bag is None else str(bag),
        "pictures": [str(picture) for picture in pictures],
        "reason": reason or None,
    }


def text_report(record: RunRecord, analysis: RunAnalysis) -> str:
    """Return the tables and totals, centimetres and degrees, u to the right and v forward."""
    said = [f"{key} {record.details[key]}" for key in ("predictor", "surface", "seed") if record.details.get(key)]
    known = conditions_text(run_facts(record.details)["conditions"])
    said += [known] if known else []
    head = f"{analysis.scenario or 'formation run'}{': ' if said else ''}{', '.join(said)}"
    sections = [head]
    for follower in analysis.followers:
        if len(analysis.followers) > 1:
            sections.append(follower.name.replace("_", " "))
        sections.append("\n".join(_table(follower)))
        sections.append("\n".join(_totals(follower)))
    if analysis.string_stability is not None:
        sections.append("\n".join(["along the chain", *_along_the_chain(analysis.string_stability)]))
    sections.append(f"outcome: {analysis.outcome}{_who_is_lost(analysis)}")
    return "\n\n".join(sections)


def write_pictures(
    record: RunRecord,
    analysis: RunAnalysis,
    folder: str | Path,
    picture_format: str = "png",
    *,
    overhead: bool = False,
) -> list[Path]:
    """Draw the run's pictures into a folder, made if it is missing; pictures of an older analysis are replaced.

    Args:
        record: the run.
        analysis: the same run's quantities.
        folder: where to.
        picture_format: png, svg or pdf.
        overhead: whether the trajectory shows what the overhead tracker saw.

    Raises:
        AnalysisError: the folder or a picture can't be written.
    """
    out = made_folder(folder)
    return [
        draw_trajectory(record, analysis, out / f"trajectory.{picture_format}", overhead=overhead),
        draw_corrections(record, analysis, out / f"corrections.{picture_format}"),
        draw_formation_error(record, analysis, out / f"formation_error.{picture_format}"),
        draw_eigenvalues(record, analysis, out / f"eigenvalues.{picture_format}"),
    ]


def pictures_folder(bag: str | Path) -> Path:
    """Return where pictures of a bag go by default: a folder beside it, which need not exist."""
    return Path(bag).resolve().with_name(f"{bag_name(bag)}_analysis")


def made_folder(folder: str | Path) -> Path:
    """Make a folder if it is missing.

    Raises:
        AnalysisError: it can't be made.
    """
    out = Path(folder)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise AnalysisError(f"{out} can't be made: {error.strerror or error}; choose another folder") from error
    return out


def _table(follower: FollowerAnalysis) -> list[str]:
    lines = [_line(header) for header in _HEADERS]
    lines.append("-" * (sum(_WIDTHS) + 2 * (len(_WIDTHS) - 1)))
    return lines + [_line(_cells(timestep)) for timestep in follower.timesteps]


def _cells(timestep: Timestep) -> tuple[str, ...]:
    corrections = timestep.corrections
    return (
        str(timestep.t),
        _uv(timestep.predicted),
        _uv(timestep.moved),
        _pair(corrections.u_m, corrections.v_m),
        _uv(timestep.residual),
        str(corrections.movements),
        _scaled(timestep.formation_error_m, 100.0),
        _scaled(timestep.heading_error_rad, math.degrees(1.0)),
    )


def _line(cells: Sequence[str]) -> str:
    return "  ".join(cell.rjust(width) for cell, width in zip(cells, _WIDTHS, strict=True)).rstrip()


def _uv(motion: Motion | None) -> str:
    return _NONE if motion is None else _pair(motion.u_m, motion.v_m)


def _pair(u_m: float, v_m: float) -> str:
    return f"{_scaled(u_m, 100.0)} {_scaled(v_m, 100.0):>6}"


def _scaled(value: float | None, scale: float) -> str:
    # Adding zero turns a rounded -0.0 into 0.0.
    return _NONE if value is None else f"{round(value * scale, 2) + 0.0:.2f}"


def _totals(follower: FollowerAnalysis) -> list[str]:
    values = follower.totals
    planned = values["timesteps_planned"]
    said: list[tuple[str, str]] = [
        ("timesteps finished", f"{values['timesteps_finished']}{'' if planned is None else f' of {planned}'}"),
        (f"correction distance from timestep {COLLECTION_TIMESTEPS + 1}", _correction(values)),
        ("correction moves", _movements(values)),
        *_moves(values),
        *_lost(values),
        *_losses(values),
        ("formation error", _formation_error(values)),
        *_at_worst(values),
        ("heading error", f"RMSE {_scaled(values['heading_error_rmse_rad'], math.degrees(1.0))} deg"),
        ("path", ", ".join(f"{robot} {length:.3f} m" for robot, length in values["path_length_m"].items()) or _NONE),
        *_overhead_error(values),
        ("simulated time", f"{values['simulated_seconds']:.1f} s"),
    ]
    unfinished = values["unfinished_timestep"]
    if unfinished:
        u, v = (_scaled(unfinished[key], 100.0) for key in ("correction_u_m", "correction_v_m"))
        moves = unfinished["movements"]
        said.insert(1, ("unfinished timestep", f"{unfinished['t']}: {moves} correction moves (u {u}, v {v} cm)"))
    width = max(len(name) for name, _ in said)
    return [f"{name.ljust(width)}  {value}" for name, value in said]


def _correction(values: JsonObject) -> str:
    if values["correction_m"] is None:
        return _NONE
    u, v, both = (_scaled(values[key], 100.0) for key in ("correction_u_m", "correction_v_m", "correction_m"))
    return f"{both} cm (u {u}, v {v}), turns {_scaled(values['correction_turn_rad'], math.degrees(1.0))} deg"


def _movements(values: JsonObject) -> str:
    per_timestep = values["movements_per_timestep"]
    return f"{values['movements']}{'' if per_timestep is None else f' ({per_timestep:.2f} per timestep)'}"


def _moves(values: JsonObject) -> list[tuple[str, str]]:
    axes, kinds = values["moves_by_axis"], values["moves_by_kind"]
    said = [("  by axis", ", ".join(f"{axis} {count}" for axis, count in axes.items()))] if axes else []
    if kinds:
        said.append(("  by kind", ", ".join(f"{kind} ({count})" for kind, count in kinds.items())))
    return said


def _who_is_lost(analysis: RunAnalysis) -> str:
    """Name the followers that have lost their neighbours, where there are several."""
    lost = [f"{f.name} in timestep {f.totals['lost']['t']}" for f in analysis.followers if f.totals["lost"]]
    return f" ({', '.join(lost)})" if lost and len(analysis.followers) > 1 else ""


def _lost(values: JsonObject) -> list[tuple[str, str]]:
    lost = values["lost"]
    if lost is None:
        return []
    when = "" if lost["seconds"] is None else f", at {lost['seconds']:.1f} s"
    return [("neighbour lost", f"in timestep {lost['t']}{when}{': ' if lost['reason'] else ''}{lost['reason'] or ''}")]


def _losses(values: JsonObject) -> list[tuple[str, str]]:
    losses = values["losses"]
    if not losses:
        return []
    text = f"{len(losses)}, {values['reacquired']} of them reacquired"
    if values["reacquisition_median_s"] is not None:
        median_s, max_s = values["reacquisition_median_s"], values["reacquisition_max_s"]
        text += f" (median {median_s:.1f} s, longest {max_s:.1f} s)"
    return [("neighbour out of view", text)]


def _formation_error(values: JsonObject) -> str:
    keys = ("rmse_m", "bias_u_m", "bias_v_m", "scatter_m")
    rmse, bias_u, bias_v, scatter = (_scaled(values[f"formation_error_{key}"], 100.0) for key in keys)
    return f"RMSE {rmse} cm (bias u {bias_u}, v {bias_v}; scatter {scatter})"


def _at_worst(values: JsonObject) -> list[tuple[str, str]]:
    if values["formation_error_moving_max_m"] is None or values["gap_min_m"] is None:
        return []
    end, moving, gap = (
        _scaled(values[key], 100.0) for key in ("formation_error_max_m", "formation_error_moving_max_m", "gap_min_m")
    )
    touched = f", touches {values['touches']}" if values["touches"] else ""
    return [
        ("  largest", f"at ends of timesteps {end} cm, in motion {moving} cm"),
        ("gap to the neighbour's body", f"at least {gap} cm{touched}"),
    ]


def _along_the_chain(values: JsonObject) -> list[str]:
    """List ratios from each robot to the next; one column per follower, from the second on where errors are meant."""
    hops = values["hops"]
    rows = [
        (f"error to that of the one before, {name}", ["", *(_scaled(hop[key], 1.0) for hop in hops)])
        for name, key in (("RMS", "error_ratio_l2"), ("max", "error_ratio_linf"))
    ]
    rows += [
        (f"gain along {found['axis']}, period {found['period']:.1f}", [_scaled(gain, 1.0) for gain in found["hops"]])
        for found in values["gains"]
    ]
    width = max(len(name) for name, _ in rows)
    numbers = [str(number) for number in range(1, len(hops) + 2)]
    return [
        "".join([name.ljust(width), *(cell.rjust(6) for cell in cells)])
        for name, cells in [("follower", numbers), *rows]
    ]


def _overhead_error(values: JsonObject) -> list[tuple[str, str]]:
    errors = values["overhead_error_m"] or {}
    texts = [
        f"{robot} RMS {_scaled(error['rms'], 100.0)}, max {_scaled(error['max'], 100.0)} cm"
        for robot, error in errors.items()
    ]
    return [("overhead camera", "; ".join(texts))] if texts else []
