"""What runs say of themselves, and in what of it they differ."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from robot_formation.bag.run_details import node_parameters, value
from robot_formation.errors import shown
from robot_formation.json_values import Json, JsonObject

_COUNTED = ("dropped", "lost")  # what a recorder missed says nothing of the run
_REPEATED = ("predictor", "path", "surface", "surface_parameters", "timesteps", "camera", "seed")
_DEPTH = 2  # of what is taken apart: drive_curves.ROBOT.AXIS


def run_settings(details: Mapping[str, str]) -> JsonObject:
    """List what a run says of itself by dotted name: scenario, parameters by node, calibrations, versions, commit.

    What is said twice, at the top and among the nodes' parameters, is listed as a parameter only.
    """
    nodes = node_parameters(details)
    found: JsonObject = {}
    for name, text in details.items():
        if name in _COUNTED or name == "parameters" or (nodes and name in _REPEATED):
            continue
        found.update(_flat(name, value(text)))
    for node, parameters in nodes.items():
        found.update({f"{node}.{name}": entry for name, entry in parameters.items()})
    return found


def differing(details: Sequence[Mapping[str, str]]) -> dict[str, list[Json]]:
    """List what differs between runs: its values by name, in the order of the runs; None where a run doesn't say."""
    settings = [run_settings(each) for each in details]
    names = dict.fromkeys(name for each in settings for name in each)
    found = {name: [each.get(name) for each in settings] for name in names}
    return {name: values for name, values in found.items() if any(value != values[0] for value in values)}


def value_text(entry: Json, most: int = 60) -> str:
    """Write a parameter's value for a table, at most so many characters of it; '-' for None."""
    if entry is None:
        return "-"
    if isinstance(entry, bool):
        return str(entry).lower()
    if isinstance(entry, str):
        text = entry or '""'
    elif isinstance(entry, (int, float)):
        return f"{entry:.10g}" if isinstance(entry, float) else shown(entry)
    else:
        try:
            text = json.dumps(entry, ensure_ascii=False)
        except RecursionError:
            text = shown(entry)
    return text if len(text) <= most else f"{text[: most - 4]} ..."


def _flat(name: str, entry: Json, depth: int = 0) -> JsonObject:
    if not isinstance(entry, dict) or depth == _DEPTH:
        return {name: entry}
    found: JsonObject = {}
    for key, inner in entry.items():
        found.update(_flat(f"{name}.{key}", inner, depth + 1))
    return found
