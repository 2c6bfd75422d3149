"""A run in sentences: what was run, and whether it held the formation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from robot_formation.analysis.quantities import FollowerAnalysis
from robot_formation.bag.run_details import mapping, node_parameters
from robot_formation.errors import FormationError
from robot_formation.geometry.se2 import Motion
from robot_formation.json_values import Json
from robot_formation.reporting.comparison_table import number_text
from robot_formation.reporting.differences import value_text
from robot_formation.reporting.runs import Run
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS
from robot_formation.world.pushes import read_push

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
    """Describe a run: robots, ground, path, predictor, alignment, camera, blackouts, pushes; if it tells them."""
    count, facts = len(run.analysis.followers), run.facts
    conditions = facts["conditions"]
    who = "One follower keeps its place" if count == 1 else f"{count} followers keep their places"
    delayed = ", where the neighbour stood one timestep earlier (spacing delayed)" if run.record.delayed else ""
    ground = f" on the surface \u201c{value_text(facts['surface'])}\u201d" if facts["surface"] else ""
    said = [f"{who} {_places(run)}{delayed}{ground}."]
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
    said += _disturbances(run)
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
            f"From timestep {COLLECTION_TIMESTEPS + 1} on it corrected {number_text(totals['correction_m'], _CM)} cm; "
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


def _places(run: Run) -> str:
    """Describe where each follower's place is, once for those that have the same."""
    followers = [follower.name for follower in run.record.followers]
    whom = "the leader" if len(followers) == 1 else "the robot before it"
    found = [(_place(place, whom), list(robots)) for place, robots in groupby(followers, run.record.place)]
    if len(followers) == 1:
        return found[0][0]
    if len(found) == 1:
        return f"in a row, each {found[0][0]}"
    return "in a row: " + "; ".join(f"{_listed(robots)} {place}" for place, robots in found)


def _place(place: Motion, whom: str) -> str:
    """Describe a place in the frame of a neighbour, who is named by words."""
    right = f"{number_text(place.u_m, _CM, 1)} cm to the right of {whom}"
    if place.v_m == 0.0:
        return right
    return f"{right} and {number_text(abs(place.v_m), _CM, 1)} cm {'ahead of' if place.v_m > 0.0 else 'behind'} it"


def _disturbances(run: Run) -> Iterator[str]:
    """Describe timesteps without cameras, and pushes; what can't be read, from a bag of somebody else, is left out."""
    details = run.record.details
    nodes = node_parameters(details)
    common = _blackouts(nodes.get("fine_tuner", {}).get("blackouts"))
    if common:
        yield f"No follower had a camera in {_timesteps(common)}."
    for robot, numbers in mapping(details, "own_blackouts").items():
        own = [span for span in _blackouts(numbers) if span not in common]
        if own:
            yield f"{robot.replace('_', ' ').capitalize()} had no camera in {_timesteps(own)}."
    pushes = nodes.get("world", {}).get("pushes")
    for text in pushes if isinstance(pushes, list) else []:
        try:
            push = read_push(str(text))
        except FormationError:
            continue
        ahead, left = (number_text(length_m, _CM, 1) for length_m in (push.x_m, push.y_m))
        robot = push.robot.replace("_", " ").capitalize()
        yield f"{robot} was pushed by {ahead} cm ahead and {left} cm to the left in timestep {push.timestep}."


def _blackouts(numbers: Json) -> list[tuple[int, int]]:
    """Pair first timesteps and lengths; none where it is something else."""
    if not isinstance(numbers, list) or any(type(number) is not int for number in numbers):
        return []
    return list(zip(numbers[::2], numbers[1::2], strict=False))


def _timesteps(spans: Sequence[tuple[int, int]]) -> str:
    """List the timesteps of blackouts (first, length)."""
    texts = [str(first) if length == 1 else f"{first} to {first + length - 1}" for first, length in spans]
    return f"timestep{'' if len(spans) == 1 and spans[0][1] == 1 else 's'} {_listed(texts)}"


def _listed(texts: Sequence[str]) -> str:
    """Join texts with commas and a last 'and'."""
    said = [text.replace("_", " ") for text in texts]
    return " and ".join(filter(None, [", ".join(said[:-1]), said[-1]]))


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
