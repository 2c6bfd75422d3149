"""Whether followers can keep their slots: apart from neighbours, and with one marker in view, the neighbour's."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.geometry.footprint import footprint_gap_m
from robot_formation.geometry.se2 import Motion, into_frame
from robot_formation.geometry.slots import Slots, slot
from robot_formation.parameters import ParameterError

LEAST_GAP_M = 0.01
"""Bodies that come nearer than this may touch: a formation is never exact."""
_TRIED_MM = range(-400, 401, 5)


def check_slots(slots: Slots, world: WorldNodeParameters, step: Motion) -> None:
    """Check the places in formation, and where a follower stands when its neighbour has made its step.

    Args:
        slots: the followers' places.
        world: bodies, markers and cameras.
        step: the neighbour's, of a straight path.

    Raises:
        ParameterError: naming the first follower whose place won't do, and what would.
    """
    length_m, width_m = world.chassis.length_m, world.chassis.width_m
    for number, place in enumerate(slots, 1):
        where = f"{names.follower(number)}'s place, {place.u_m:g} m beside its neighbour and {_ahead(place.v_m)}"
        if footprint_gap_m(place, length_m, width_m) < LEAST_GAP_M:
            raise ParameterError(
                f"{where}: the bodies would be within a centimetre of each other; give {width_m + LEAST_GAP_M:.3f} m "
                "beside or more"
            )
        if place.v_m and not _seen(world, place, (Motion(), step)):
            fitting = [mm / 1e3 for mm in _TRIED_MM if _seen(world, slot(place.u_m, mm / 1e3), (Motion(), step))]
            fits = f"; from {_ahead(min(fitting))} to {_ahead(max(fitting))} it would" if fitting else ""
            raise ParameterError(f"{where}: its camera would not have the whole Target face in view{fits}")
        if number > 1 and (place.v_m or slots[number - 2].v_m) and _shows(world, place, slots[number - 2]):
            raise ParameterError(
                f"{where}: its camera would see the marker of the robot beyond the neighbour, past the neighbour's "
                "board; let the offset differ less from that of the follower before it"
            )


def sees_target(world: WorldNodeParameters, place: Motion, step: Motion) -> bool:
    """Whether a follower that hasn't moved yet has its neighbour's whole Target face between its picture's sides.

    Args:
        world: cameras and markers.
        place: the follower's, in the neighbour's frame before its step.
        step: of the neighbour.
    """
    half_m = 0.5 * world.marker.edge_m
    columns = _columns(world, place.inverse().then(step), [(-half_m, -half_m), (half_m, -half_m)])
    return bool(np.all((columns >= 0.0) & (columns < world.camera.width_px)))


def _seen(world: WorldNodeParameters, place: Motion, steps: Sequence[Motion]) -> bool:
    return all(sees_target(world, place, step) for step in steps)


def _shows(world: WorldNodeParameters, place: Motion, beyond: Motion) -> bool:
    """Whether the marker of the neighbour's neighbour shows in the picture beside the neighbour's marker and board.

    Args:
        world: cameras and markers.
        place: the follower's, in its neighbour's frame.
        beyond: the neighbour's, in the frame of the robot on its own left.
    """
    half_m, board_m = 0.5 * world.marker.edge_m, 0.5 * max(world.marker.backdrop_m, world.marker.edge_m)
    near = place.inverse()
    hidden = _columns(world, near, [(-board_m, half_m), (board_m, half_m), (-half_m, -half_m), (half_m, -half_m)])
    corners = [(along * half_m, aside * half_m) for along in (-1.0, 1.0) for aside in (-1.0, 1.0)]
    seen = np.clip(_columns(world, near.then(beyond.inverse()), corners), 0.0, world.camera.width_px)
    return bool(seen.min() < hidden.min() or seen.max() > hidden.max()) and bool(np.ptp(seen))


def _columns(world: WorldNodeParameters, robot: Motion, points: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
    """Columns at which a follower's camera sees points of another robot on level ground; infinite behind the lens.

    Args:
        world: cameras.
        robot: pose of the other robot in the follower's frame.
        points: in the other robot's frame, x and y, metres.
    """
    camera = world.camera
    columns = []
    for x_m, y_m in points:
        point = robot.then(Motion(x_m, y_m))
        ahead, left = into_frame(point.x_m - camera.x_m, point.y_m - camera.y_m, math.radians(camera.pan_deg))
        columns.append(camera.centre_x_px - camera.focal_length_px * left / ahead if ahead > 0.0 else math.inf)
    return np.array(columns)


def _ahead(offset_m: float) -> str:
    return f"{abs(offset_m):g} m {'behind' if offset_m < 0.0 else 'ahead'}"
