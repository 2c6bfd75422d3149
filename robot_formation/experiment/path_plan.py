"""What follows from the leader's path beforehand: the start, the room that it has, and the followers' first step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import Slots, leader_places
from robot_formation.leader.leader_motion import LeaderParameters
from robot_formation.leader.paths import LeaderPath
from robot_formation.leader.rigid_formation import (
    Formation,
    Track,
    around,
    centred_start,
    follower_step,
    room_around,
    track_of,
)
from robot_formation.parameters import ParameterError
from robot_formation.surface import plate_size

STRAIGHT = "straight"
_LONGEST_V_M, _LONGEST_U_M, _TOUCH_M = 0.15, 0.1, 0.007
"""Longest prediction moves on a path that isn't straight, and how near of the bodies' gap along u: 7.5 cm of 8.2."""
_WALK = "random_walk"

KNOWN_STEP: Mapping[str, Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "fine_tuner": {
            "first_step_m": ("v", 0.2),
            "first_step_u_m": ("u", 0.1),
            "first_turn_rad": ("turn", 1.1),
        },
        "predictor": {
            "closing.step_v_m": ("v", 1.0),
            "closing.step_u_m": ("u", 1.0),
            "closing.step_turn_rad": ("turn", 3.2),
        },
    }
)
"""Parameters that say a follower's first step, by node: its component and the largest value."""


def known_step(kind: str, leader: LeaderParameters, place: Motion, settings: Mapping[str, object]) -> dict[str, object]:
    """Return a node's parameters that say the first step of a follower, apart from those that are set.

    Its place is given in the leader's frame.

    A path that can't be made says nothing here: `Scenario.check` tells what is wrong with it.
    """
    try:
        step = follower_step(leader.make_path().motion(1), place)
    except ParameterError:
        return {}
    parts = {"u": step.u_m + 0.0, "v": step.v_m, "turn": step.yaw_rad}
    return {
        name: max(-most, min(most, parts[part]))
        for name, (part, most) in KNOWN_STEP[kind].items()
        if name not in settings
    }


def prediction_bounds(leader: LeaderParameters, slots: Slots, world: WorldNodeParameters) -> dict[str, float]:
    """Return the fine-tuner's bounds of prediction moves for a path; those of straight ones are its defaults.

    A sideways step that is cut loses the residual that it was to take out too; one as long as the bodies' gap would
    push a neighbour that stands still.
    """
    if leader.path == STRAIGHT:
        return {}
    gap_m = min(place.u_m for place in slots) - world.chassis.width_m - _TOUCH_M
    return {"max_v_m": _LONGEST_V_M, "max_u_m": min(max(gap_m, 0.0), _LONGEST_U_M)}


def path_start(
    leader: LeaderParameters, slots: Slots, heading_deg: float, world: WorldNodeParameters
) -> tuple[float, float] | None:
    """Return the start that puts everything that the formation sweeps in the plate's middle; None for `straight`.

    None too if path or plate can't be made, which `Scenario.check` tells.
    """
    if leader.path == STRAIGHT:
        return None
    try:
        plate_m = plate_size(world.surface, world.surface_parameters)
        path = replace(leader, room_m=()).make_path()
    except ParameterError:
        return None
    whole = formation(world, slots)
    found = centred_start(swept_by(path, leader.timesteps, whole, math.radians(heading_deg)), plate_m)
    # A path that is too large starts somewhere on the plate: `Scenario.check` then tells what is too large.
    x_m, y_m = (min(max(value, 0.0), plate_m) for value in found)
    return (x_m, y_m)


def swept_by(path: LeaderPath, timesteps: int, whole: Formation, heading_rad: float) -> Track:
    """Box around all that a formation takes over a run from (0, 0); of a random walk, which goes where there is room,
    its start's only. Lowest x, highest x, lowest y, highest y, metres.
    """
    steps = 0 if path.name == _WALK else timesteps
    swept: Track = around(whole.boxes(track_of(path, steps, Motion(yaw_rad=heading_rad))))[-1]
    return swept


def with_room(leader: LeaderParameters, world: WorldNodeParameters, slots: Slots) -> LeaderParameters:
    """Tell a random walk how far it may go."""
    if leader.path != _WALK:
        return leader
    try:
        plate_m = plate_size(world.surface, world.surface_parameters)
    except ParameterError:
        return leader
    start = Motion(world.start_x_m[0], world.start_y_m[0], world.start_heading_rad[0])
    room = room_around(formation(world, slots), start, plate_m)
    return replace(leader, room_m=(room.ahead_m, room.behind_m, room.left_m, room.right_m))


def formation(world: WorldNodeParameters, slots: Slots) -> Formation:
    """Return the formation of a world's robots."""
    return Formation(leader_places(slots), world.chassis.length_m, world.chassis.width_m)
