"""The conditions of a run: what has to be the same in runs whose figures are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robot_formation.bag.run_details import node_parameters, said_slots, stand_ins, whole_number
from robot_formation.json_values import JsonObject

_SEED_DIGITS = 19  # of 2^63 - 1


def conditions(
    parameters: Mapping[str, Mapping[str, object]], slots: Sequence[tuple[float, float]] = ()
) -> dict[str, object]:
    """List the conditions of a run by name; None where unknown, or where no run has such a value.

    Args:
        parameters: those of the run's nodes, flat, by kind of node; kinds may be missing.
        slots: how far each follower's place is to the right of its neighbour and ahead of it, metres; empty: unknown.
    """
    world, fine_tuner = parameters.get("world", {}), parameters.get("fine_tuner", {})
    robots = world.get("robots")
    return {
        "mode": _word(fine_tuner.get("mode")),
        "camera": _word(world.get("camera.mode")),
        "marker": _word(world.get("marker.kind")),
        "followers": len(robots) - 1 if isinstance(robots, (list, tuple)) and robots else None,
        "drive_mode": _word(world.get("motor.drive_mode")),
        **{
            name: found
            for name, usual in (("schedule", "turns"), ("spacing", "rigid"))
            if (found := _word(fine_tuner.get(name))) not in (None, usual)
        },
        **({} if _abreast(slots) else {"slots": [list(pair) for pair in slots]}),
    }


def conditions_text(found: Mapping[str, object]) -> str:
    """Describe the conditions in a line; what is unknown is left out, and so is what nearly every run has."""
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
    if found.get("schedule") not in (None, "turns"):
        said.append(f"schedule {found['schedule']}")
    if found.get("spacing") not in (None, "rigid"):
        said.append(f"spacing {found['spacing']}")
    if found.get("slots"):
        said.append(f"slots {found['slots']} m")
    return ", ".join(said)


def _abreast(slots: Sequence[tuple[float, float]]) -> bool:
    """Whether all places are beside their neighbours at the same distance, which the nodes' parameters say."""
    return len(set(slots)) < 2 and not any(ahead_m for _, ahead_m in slots)


def _word(found: object) -> str | None:
    """Return a choice's name; None if it can be none, so that nothing else is printed."""
    return found if isinstance(found, str) and found.isascii() and found.isidentifier() else None


def run_facts(details: Mapping[str, str], *, in_process: bool | None = None) -> JsonObject:
    """Return which run it was, as the command line's JSON has it: seed, predictor, path, surface, conditions.

    Args:
        details: what the run says of itself, as `launching.processes.run_metadata` puts it.
        in_process: whether it ran in one process, which it doesn't say.
    """
    found = conditions(node_parameters(details), said_slots(details))
    return {
        "seed": whole_number(details, "seed", _SEED_DIGITS),
        "predictor": details.get("predictor"),
        "path": _word(node_parameters(details).get("leader", {}).get("path", "straight" if details else None)),
        "surface": details.get("surface"),
        "conditions": {**found, "in_process": in_process},
        **({"stand_ins": nodes} if (nodes := stand_ins(details)) else {}),
    }
