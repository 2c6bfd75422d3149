"""Defaults that follow from how many followers a scenario has, and from its schedule."""

from __future__ import annotations

from collections.abc import Mapping

from robot_formation.schedule.schedules import Schedule, Spacing
from robot_formation.vision.marker import MarkerKind
from robot_formation.world.parameters import MarkerParameters

_DARK = {"marker.backdrop_rgb": (12, 12, 13)}
"""With delayed spacing a look is at a robot that stands ahead, whose Rear face shows as a narrow strip: before a light
board that is a block now and then, and chains of ten were lost."""
_BACKDROP: dict[str, object] = {"marker.backdrop_m": 0.16}
"""Boards behind the markers of a chain: without them a follower sees its neighbour's neighbour's marker beside its
neighbour's as soon as they don't stand in a row, and takes both for one that is nearer. Hides 8 cm per robot."""
_BEFORE_LIGHT_BOARD = {"precise.edges.target_bottom_px": -1.8}
"""Before a light board the detector ends the Target block 0.7 px higher than before the robot's own body: measured as
`bench/marker_edges.py --board` does. Uncorrected, followers stand 6 mm too near."""
_LEAST_LIGHT = 180
"""Least colour component of such a board."""
_HEADING_CHECK = "precise.heading_check."
_NO_HEADING_CHECKS = {
    f"{_HEADING_CHECK}turned_rad": 1000.0,
    f"{_HEADING_CHECK}beside_sigmas": 1e6,
    f"{_HEADING_CHECK}sigma_rad": 1000.0,
}
_FEW_TURNS = {"precise.filter.step.change_sigma_rad": 0.003}
"""Where nobody checks headings, the filter's model of a step that nothing foretells hardly turns: such a turn would be
forecast again, and for the first 10 degrees or more the Target face alone shows, which does not contradict it. With the
default a follower on a slalom turned away by 24 degrees in nine timesteps."""

_CHAIN_TOLERANCES = {"precise.u_tolerance_m": 0.005, "precise.v_tolerance_m": 0.004}
"""In a chain a correction of several millimetres aside looks like a turn to the follower behind: 1 mm on a step of 5 cm
is 1.1 degrees, and a heading that is 1 degree off puts that follower 6 mm beside its place. So corrections begin
sooner, and are smaller, than those of a single follower, which begin at 9 and 6 mm."""


def backdrop(followers: int, spacing: Spacing, own: Mapping[str, object]) -> dict[str, object]:
    """Return the world's parameters of a chain's markers, apart from those that are set."""
    found = {**_BACKDROP, **(_DARK if spacing is Spacing.DELAYED else {})}
    return {name: value for name, value in found.items() if followers > 1 and name not in own}


def edges_before_board(marker: MarkerParameters, own: Mapping[str, object]) -> dict[str, float]:
    """Return the fine-tuner's parameters of how the edges of a marker before its board are reported."""
    light = marker.backdrop_m > 0.0 and min(marker.backdrop_rgb) >= _LEAST_LIGHT
    biased = light and marker.kind is MarkerKind.COLOURS  # a tag's box is that of its face
    return {name: value for name, value in _BEFORE_LIGHT_BOARD.items() if biased and name not in own}


def chain_tolerances(followers: int, schedule: Schedule, own: Mapping[str, object]) -> dict[str, float]:
    """Return the fine-tuner's tolerances where several followers correct one after the other."""
    found = _CHAIN_TOLERANCES if followers > 1 and not schedule.at_once else {}
    return {name: value for name, value in found.items() if name not in own}


def at_once_alignment(schedule: Schedule, own: Mapping[str, object]) -> dict[str, float]:
    """Return the fine-tuner's parameters of a schedule that has no time to drive to where the heading shows."""
    if not schedule.at_once:
        return {}
    checks = any(name.startswith(_HEADING_CHECK) for name in own)
    found = _NO_HEADING_CHECKS if checks else {**_NO_HEADING_CHECKS, **_FEW_TURNS}
    return {name: value for name, value in found.items() if name not in own}
