"""What a page says of one run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from robot_formation.analysis.figures import draw_corrections, draw_trajectory
from robot_formation.analysis.quantities import FollowerAnalysis, Timestep
from robot_formation.bag.run_details import mapping
from robot_formation.geometry.se2 import Motion
from robot_formation.reporting.changed_parameters import changed_parameters
from robot_formation.reporting.comparison_figures import draw_errors_by_timestep
from robot_formation.reporting.comparison_table import comparisons, number_text
from robot_formation.reporting.differences import value_text
from robot_formation.reporting.inline_svg import figure
from robot_formation.reporting.markup import element, paragraph, section, table
from robot_formation.reporting.repetition import repetition
from robot_formation.reporting.replay import replay_section
from robot_formation.reporting.runs import Run
from robot_formation.reporting.words import answer, how_it_was_held, what_was_run

_CM, _DEG = 100.0, math.degrees(1.0)
_LONG_VALUE = 300
_NONE = "-"


def run_sections(run: Run, folder: Path, level: int) -> Iterator[Element]:
    """Yield the sections of a run's report.

    Args:
        run: the run.
        folder: where figures are put for the moment.
        level: of their headings.
    """
    yield section("What was run", paragraph(what_was_run(run)), level=level)
    followers = run.analysis.followers
    held = [paragraph(how_it_was_held(run, follower)) for follower in followers]
    key = [_key_figures(follower) for follower in followers[:1]]
    yield section("Did it hold the formation?", paragraph(answer(run), class_="answer"), *key, *held, level=level)
    yield section("Corrections and errors", *_figures(run, folder), level=level)
    yield replay_section(run, level)
    yield section("Timesteps", *(_timesteps(follower) for follower in followers), level=level)
    yield section("Totals", *_totals(run), level=level)
    yield section("Parameters that differ from the defaults", *_parameters(run), level=level)
    yield section("Repeat this run", *_repeat(run), level=level)
    yield section("Versions", *_versions(run), level=level)


def _key_figures(follower: FollowerAnalysis) -> Element:
    totals = follower.totals
    shown = (
        ("correction distance", number_text(totals["correction_m"], _CM, 1), "cm"),
        ("formation error, RMSE", number_text(totals["formation_error_rmse_m"], _CM), "cm"),
        ("heading error, RMSE", number_text(totals["heading_error_rmse_rad"], _DEG), "deg"),
        ("movements per timestep", number_text(totals["movements_per_timestep"], 1.0), ""),
    )
    boxes = [
        element("div", element("dt", name), element("dd", f"{text} {unit}".strip() if text != _NONE else text))
        for name, text, unit in shown
    ]
    return element("dl", *boxes, class_="key")


def _figures(run: Run, folder: Path) -> list[Element]:
    name, about = f"run-{run.number}", f"{run.analysis.scenario or 'run'}, {run.name}"
    return [
        figure(
            f"{name}-corrections",
            lambda path: draw_corrections(run.record, run.analysis, path),
            folder,
            title=f"Bar chart: correction distance of each timestep along u and v; {about}",
            caption="Correction distance of each timestep: what the follower had to move after its prediction move, "
            "along u (to the right) and v (forward).",
            wide=True,
        ),
        figure(
            f"{name}-errors",
            lambda path: draw_errors_by_timestep([run], path),
            folder,
            title=f"Line chart: formation error and heading error at the end of each timestep; {about}",
            caption="Formation error and heading error at the end of each timestep, by ground truth, which the "
            "follower never knows.",
        ),
        figure(
            f"{name}-trajectory",
            lambda path: draw_trajectory(run.record, run.analysis, path),
            folder,
            title=f"Map: true paths of the robots from above over contour lines of the ground; {about}",
            caption="True paths of the robots from above, over the ground's contour lines.",
        ),
    ]


def _timesteps(follower: FollowerAnalysis) -> Element:
    heads = (
        "t",
        "predicted u",
        "v",
        "moved u",
        "v",
        "correction u",
        "v",
        "residual u",
        "v",
        "movements",
        "formation error",
        "heading error, deg",
    )
    rows = [_timestep(timestep) for timestep in follower.timesteps]
    title = f"Timesteps of {follower.name.replace('_', ' ')}; lengths in cm, u to the right, v forward"
    return table(title, heads, rows, class_="steps")


def _timestep(timestep: Timestep) -> list[str]:
    corrections = timestep.corrections
    return [
        str(timestep.t),
        *_uv(timestep.predicted),
        *_uv(timestep.moved),
        number_text(corrections.u_m, _CM),
        number_text(corrections.v_m, _CM),
        *_uv(timestep.residual),
        str(corrections.movements),
        number_text(timestep.formation_error_m, _CM),
        number_text(timestep.heading_error_rad, _DEG),
    ]


def _uv(motion: Motion | None) -> tuple[str, str]:
    return (_NONE, _NONE) if motion is None else (number_text(motion.u_m, _CM), number_text(motion.v_m, _CM))


def _totals(run: Run) -> Iterator[Element]:
    for found in comparisons([run])[1:]:
        yield table(f"Totals of {found.title}", ("quantity", "value"), [(name, *values) for name, values in found.rows])


def _parameters(run: Run) -> Iterator[Element]:
    if not mapping(run.record.details, "parameters"):
        yield paragraph("The run does not tell its parameters.")
        return
    found = changed_parameters(run.record.details)
    if not found:
        yield paragraph("None.")
        return
    yield paragraph(
        "Against the defaults on the nodes' pages; starts and seeds follow from the scenario.", class_="quiet"
    )
    rows = [
        (
            element("code", each.name),
            _with_unit(value_text(each.value, _LONG_VALUE), each.unit),
            _with_unit(value_text(each.default, _LONG_VALUE), each.unit),
            each.description,
        )
        for each in found
    ]
    yield table("Changed parameters", ("parameter", "in this run", "default", "what it is"), rows, class_="words")


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit and text != _NONE else text


def _repeat(run: Run) -> Iterator[Element]:
    found = repetition(run.record.details)
    if found is None:
        why = "the run does not tell all of its parameters, or this version can't run them"
        yield paragraph(f"No command can be given that repeats this run: {why}.")
        return
    yield element("pre", element("code", found.command), tabindex="0")
    if found.missed:
        yield paragraph(f"Not the same: this command can't set {', '.join(found.missed)} to what they were in the run.")
    else:
        text = "This command gives every parameter the run's value"
        yield paragraph(
            f"{text}; with the same versions it gives the same run, also with --in-process.", class_="quiet"
        )


def _versions(run: Run) -> Iterator[Element]:
    details: Mapping[str, str] = run.record.details
    rows = [(name, value_text(version)) for name, version in mapping(details, "versions").items()]
    if details.get("git_commit"):
        rows.append(("git commit", value_text(details["git_commit"])))
    if not rows:
        yield paragraph("The run does not tell the versions that it was made with.")
        return
    yield table("Versions that recorded the run", ("what", "version"), rows, class_="words")
