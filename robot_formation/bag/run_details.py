"""What a run says of itself in its bag's metadata: texts from outside, which may be anything."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

from robot_formation.geometry.slots import Slots
from robot_formation.json_values import JsonObject

_FARTHEST_M = 100.0


def value(text: str) -> object:
    """Read a text that is JSON; one that isn't, is nested too deep or holds NaN or infinities, stays a text."""
    try:
        return json.loads(text, parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError):
        return text


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is no number that JSON has")
    return number


def mapping(details: Mapping[str, str], key: str) -> JsonObject:
    """Read a JSON object; empty where it is missing or something else."""
    found = value(details.get(key, ""))
    return found if isinstance(found, dict) else {}


def node_parameters(details: Mapping[str, str]) -> dict[str, JsonObject]:
    """Read the parameters of the run's nodes, flat, by kind of node; empty where it says none or nonsense."""
    return {kind: found for kind, found in mapping(details, "parameters").items() if isinstance(found, dict)}


def slots_text(slots: Slots) -> str:
    """Return the followers' places as the run says them: see `said_slots`."""
    return json.dumps([place.uv_m for place in slots])


def said_slots(details: Mapping[str, str]) -> list[tuple[float, float]]:
    """Read where each follower's place is, metres to its neighbour's right and ahead; empty where it is not said."""
    found = value(details.get("slots", ""))
    if not isinstance(found, list) or not all(isinstance(pair, list) and len(pair) == 2 for pair in found):
        return []
    if any(type(part) not in (int, float) or abs(part) > _FARTHEST_M for pair in found for part in pair):
        return []
    return [(float(lateral_m), float(ahead_m)) for lateral_m, ahead_m in found]


def stand_ins(details: Mapping[str, str]) -> list[str]:
    """Read which nodes somebody else had started, like 'follower_1/block_detector'; empty where it is not said."""
    found = value(details.get("stand_ins", ""))
    return [name for name in found if isinstance(name, str)] if isinstance(found, list) else []


def whole_number(details: Mapping[str, str], key: str, digits: int) -> int | None:
    """Read a number from 0 with at most so many digits; None where it is missing or something else."""
    text = details.get(key, "")
    return int(text) if text.isascii() and text.isdigit() and len(text) <= digits else None


def counts(details: Mapping[str, str], key: str) -> dict[str, int]:
    """Read how often each of some topics was counted; what is no count from 1 is left out."""
    return {topic: count for topic, count in mapping(details, key).items() if type(count) is int and count > 0}
