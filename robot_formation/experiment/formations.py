"""The formations that a scenario can name, and the places of its own: from them each follower's slot."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_formation import names
from robot_formation.geometry.slots import Slots, leader_places, slot
from robot_formation.parameters import ParameterError, suggestion

ABREAST, ECHELON = "abreast", "echelon"
FORMATIONS = (ABREAST, ECHELON)
ECHELON_AHEAD_M = -0.05
"""Offset of each follower of an echelon from its neighbour."""
_VEE = "vee"


def slots_of(formation: str, pairs: Sequence[tuple[float, float]], followers: int, distance_m: float) -> Slots:
    """Return the places of a scenario's followers, each in its neighbour's frame.

    Args:
        formation: one of `FORMATIONS`.
        pairs: distance to the right and offset ahead [m], of each follower or one pair for all; empty: by formation.
        followers: how many.
        distance_m: distance to the right in the formations that have names.

    Raises:
        ParameterError: on an unknown formation, both formation and pairs, a wrong number of pairs, or a follower that
            isn't on its neighbour's right.
    """
    _check_name(formation)
    if not pairs:
        return (slot(distance_m, ECHELON_AHEAD_M if formation == ECHELON else 0.0),) * followers
    if formation != ABREAST:
        raise ParameterError(
            f"'formation' is {formation}, but 'slots' say the places too; keep one of them "
            f"(--set formation={ABREAST}, or --set 'slots=[]')"
        )
    if len(pairs) not in (1, followers):
        raise ParameterError(
            f"'slots' must have a pair for each follower, {followers} in all, or one for all, not {len(pairs)}"
        )
    for number, (lateral_m, _) in enumerate(pairs, 1):
        if lateral_m <= 0.0:
            raise ParameterError(
                f"'slots': {names.follower(number)} would not be on its neighbour's right, and only from there its "
                "camera, which looks left, sees the Target face, which looks right; give a distance above 0"
            )
    return tuple(slot(*pair) for pair in pairs) * (1 if len(pairs) == followers else followers)


def starts_of(x_m: float, y_m: float, heading_deg: float, slots: Slots) -> dict[str, object]:
    """Return the world's parameters that say where robots stand in formation, from the leader's start and heading."""
    heading = math.radians(heading_deg)
    cosine, sine = math.cos(heading), math.sin(heading)
    places = leader_places(slots)
    return {
        "start_x_m": [x_m + (place.x_m * cosine - place.y_m * sine) for place in places],
        "start_y_m": [y_m + (place.x_m * sine + place.y_m * cosine) for place in places],
        "start_heading_rad": [heading] * len(places),
    }


def _check_name(formation: str) -> None:
    if formation == _VEE:
        raise ParameterError(
            "'formation' can't be vee: a follower on the leader's left can't see its Target face, which looks right; "
            f"take {ECHELON}, or 'slots' for a vee with the leader at its left end"
        )
    if formation not in FORMATIONS:
        raise ParameterError(f"no formation '{formation[:40]}'{suggestion(formation, FORMATIONS)}")
