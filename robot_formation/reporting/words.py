"""A run in sentences: what was run, and whether it held the formation."""

from __future__ import annotations

from robot_formation.analysis.quantities import FollowerAnalysis
from robot_formation.reporting.comparison_table import number_text
from robot_formation.reporting.differences import value_text
from robot_formation.reporting.runs import Run

_CAMERA = {"stream": "delivers every frame", "on_demand": "delivers the frames that are asked for"}
_SCHEDULES = {
    "turns": "Robots move one after another, the leader first",
    "wave": "Each robot waits for its neighbours only (schedule wave)",
    "together": "All robots move at the same time (schedule together)",
    "timer": "Robots move by the clock and send each other nothing (schedule timer)",
}
_ANSWERS = {
    "done": "Yes, to the end.",
    "lost": "No: a follower lost its neighbour from view and did not find it again.",
    "left_plate": "No: a robot left the plate.",
    "incomplete": "The run was cut short before its last timestep.",
}
_CM = 100.0


def what_was_run(run: Run) -> str:
    """Describe a run: robots, ground, path, predictor, alignment, camera; what it doesn't tell is left out."""
    count, facts = len(run.analysis.followers), run.facts
    conditions = facts["conditions"]
    who = "One follower keeps its place" if count == 1 else f"{count} followers keep their places"
    beside = "beside the leader" if count == 1 else "in a row beside the leader"
    delayed = ", where the neighbour stood one timestep earlier (spacing delayed)" if run.record.delayed else ""
    ground = f" on the surface \u201c{value_text(facts['surface'])}\u201d" if facts["surface"] else ""
    distance = number_text(run.record.formation_distance_m, _CM, 0)
    said = [f"{who} {distance} cm {beside}{delayed}{ground}."]
    planned = run.record.timesteps_planned
    steps = f" for {planned} timesteps" if planned is not None else ""
    if facts["path"]:
        said.append(f"The leader drives the path \u201c{facts['path']}\u201d{steps}.")
    if facts["predictor"]:
        said.append(f"The predictor is \u201c{value_text(facts['predictor'])}\u201d.")
    if conditions["mode"]:
        said.append(f"Followers align by camera in mode \u201c{conditions['mode']}\u201d.")
    if conditions["camera"] in _CAMERA:
        said.append(f"The camera {_CAMERA[conditions['camera']]}.")
    if conditions["mode"]:
        said.append(f"{_SCHEDULES.get(conditions.get('schedule', 'turns'), 'Schedule unknown')}.")
    if facts["seed"] is not None:
        said.append(f"The seed is {facts['seed']}.")
    said.append(f"The run took {run.record.simulated_s:.1f} s of simulated time.")
    return " ".join(said)


def answer(run: Run) -> str:
    """Answer whether the formation was held."""
    left = f" It was: {', '.join(run.record.left_plate)}." if run.record.left_plate else ""
    return f"{_ANSWERS[run.analysis.outcome]}{left}"


def how_it_was_held(run: Run, follower: FollowerAnalysis) -> str:
    """Describe how far a follower came, how far it was from its place, and how often it lost its neighbour."""
    totals = follower.totals
    planned, finished = totals["timesteps_planned"], totals["timesteps_finished"]
    of = "" if planned is None else f" of {planned}"
    said = [f"{follower.name.replace('_', ' ').capitalize()} finished {finished}{of} timesteps."]
    rmse, largest = totals["formation_error_rmse_m"], totals["formation_error_max_m"]
    if rmse is not None and largest is not None:
        distance_m = run.record.formation_distance_m
        share = f", {100.0 * largest / distance_m:.0f} % of the distance between robots" if distance_m > 0.0 else ""
        said.append(
            f"By ground truth its formation error was {number_text(rmse, _CM)} cm (RMSE) and "
            f"at most {number_text(largest, _CM)} cm{share}."
        )
    if totals["correction_m"] is not None:
        said.append(
            f"From timestep 4 on it corrected {number_text(totals['correction_m'], _CM)} cm; "
            f"it made {_count(totals['movements'], 'correction movement')} in all."
        )
    losses = totals["losses"]
    if losses:
        when = ", ".join(sorted({str(loss["t"]) for loss in losses}, key=int))
        said.append(
            f"It lost its neighbour from view {_count(len(losses), 'time')} (timestep {when}) "
            f"and saw it again {_count(totals['reacquired'], 'time')}."
        )
    elif not follower.lost:
        said.append("It never lost its neighbour from view.")
    if totals["blind_timesteps"]:
        said.append(f"In {_count(totals['blind_timesteps'], 'timestep')} it had no camera.")
    return " ".join(said)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
