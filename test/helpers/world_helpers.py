"""What the tests of the world share."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from robot_formation.parameters import from_mapping
from robot_formation.surface import make_surface
from robot_formation.world.events import BodyState, Event, Frame, JointStates, LeftPlate, RobotPose
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World

IDEAL: dict[str, Any] = {
    "imperfections": {
        "rolling_radius": 0.0,
        "motor_gain": 0.0,
        "mass_offset_m": 0.0,
        "encoder_wheel_radius": 0.0,
        "stop_common_m": 0.0,
        "stop_wheel_m": 0.0,
    }
}
STRAIGHT = (1.0, 1.0, 1.0, 1.0)
SPEEDS = (4.0,) * 4
PAIR = (
    RobotStart("leader", 0.763, 0.3, math.pi / 2, camera=False),
    RobotStart("follower_1", 1.083, 0.3, math.pi / 2),
)


AnyEvent = TypeVar("AnyEvent", Frame, JointStates, LeftPlate, RobotPose)


def parameters(**values: Any) -> WorldParameters:
    return from_mapping(WorldParameters, values, where="test")


def world(
    surface: str = "plane",
    robots: Sequence[RobotStart] = PAIR,
    *,
    seed: int = 1,
    **values: Any,
) -> World:
    return World(make_surface(surface), robots, parameters(**values), seed=seed)


def run(a_world: World) -> list[Event]:
    """Advance until nothing is owed; all events."""
    events: list[Event] = []
    while batch := a_world.advance():
        events += batch
    return events


def of_kind(events: Iterable[Any], kind: type[AnyEvent], robot: str | None = None) -> list[AnyEvent]:
    return [event for event in events if isinstance(event, kind) and robot in (None, event.robot)]


def displacement(a_world: World, robot: str, start: BodyState) -> tuple[float, float, float]:
    """Forward, left and turn from a body state to the present one, in the frame of the former."""
    now = a_world.ground_truth(robot)
    c, s = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    dx, dy = now.x_m - start.x_m, now.y_m - start.y_m
    turn = math.remainder(now.yaw_rad - start.yaw_rad, 2 * math.pi)
    return c * dx + s * dy, -s * dx + c * dy, turn
