"""The conditions of a run: what has to be the same in runs whose figures are compared."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def conditions(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """List the conditions of a run by name; None where unknown.

    Args:
        parameters: those of the run's nodes, flat, by kind of node; kinds may be missing.
    """
    world, fine_tuner = parameters.get("world", {}), parameters.get("fine_tuner", {})
    robots = world.get("robots")
    return {
        "mode": fine_tuner.get("mode"),
        "camera": world.get("camera.mode"),
        "marker": world.get("marker.kind"),
        "followers": len(robots) - 1 if robots else None,
        "drive_mode": world.get("motor.drive_mode"),
    }


def conditions_text(found: Mapping[str, Any]) -> str:
    """Say the conditions in a line; what is unknown is left out, and so is what nearly every run has."""
    said = []
    if found.get("mode"):
        said.append(f"alignment {found['mode']}")
    if found.get("camera"):
        said.append(f"camera {found['camera']}")
    if found.get("marker") not in (None, "colours"):
        said.append(f"marker {found['marker']}")
    if found.get("followers") not in (None, 1):
        said.append(f"{found['followers']} followers")
    if found.get("drive_mode") not in (None, "pwm_stop"):
        said.append(f"drive {found['drive_mode']}")
    return ", ".join(said)


def recorded_parameters(details: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Read the nodes' parameters out of what a run says of itself; empty where it says none or nonsense."""
    try:
        found = json.loads(details.get("parameters", "{}"))
    except ValueError:
        return {}
    if not isinstance(found, dict):
        return {}
    return {kind: values for kind, values in found.items() if isinstance(values, dict)}


def run_facts(details: Mapping[str, str], *, in_process: bool | None = None) -> dict[str, Any]:
    """Return which run it was, as the command line's JSON has it: seed, predictor, surface, conditions.

    Args:
        details: what the run says of itself, as `launching.processes.run_metadata` puts it.
        in_process: whether it ran in one process, which it doesn't say.
    """
    seed = details.get("seed", "")
    return {
        "seed": int(seed) if seed.isascii() and seed.isdigit() else None,
        "predictor": details.get("predictor"),
        "surface": details.get("surface"),
        "conditions": {**conditions(recorded_parameters(details)), "in_process": in_process},
    }
