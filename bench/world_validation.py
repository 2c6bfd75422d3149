"""How far the world is from closed-form truth: kinematics on the plane, statics on slopes, creep on every surface.

Prints the figures of docs/explanation/world.md. Robots have no imperfections.

Run: python bench/world_validation.py
"""

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from robot_formation.drive.movement_system import Drive, DriveParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import from_mapping
from robot_formation.surface import SURFACES, Surface, make_surface
from robot_formation.world.events import BodyState, JointStates
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World

RADIUS_M, LEVER_M = 0.030, 0.205
MOVES = {"v 20 cm": (0.2, 0, 0), "u 10 cm": (0, 0.1, 0), "diagonal 14 cm": (0.1, 0.1, 0), "turn 0.6 rad": (0, 0, 0.6)}
IDEAL = {
    f"imperfections.{name}": 0.0
    for name in (
        "rolling_radius",
        "motor_gain",
        "mass_offset_m",
        "encoder_wheel_radius",
        "stop_common_m",
        "stop_wheel_m",
    )
}
RATE_HZ = 2
WATCHED = {
    "sleep": False,
    "camera.mode": "on_demand",
    "camera.min_frames_per_second": RATE_HZ,
    "camera.width_px": 16,
    "camera.height_px": 16,
}


def make_world(surface: Surface, x: float, y: float, heading: float, **values: Any) -> World:
    """One robot without imperfections."""
    parameters = from_mapping(WorldParameters, {**IDEAL, **values}, where="bench")
    return World(surface, [RobotStart("robot", x, y, heading)], parameters, seed=0)


def displacement(world: World, start: BodyState) -> tuple[float, float, float]:
    """Forward, left and turn since a state, in its frame."""
    now = world.ground_truth("robot")
    c, s = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    x, y = now.x_m - start.x_m, now.y_m - start.y_m
    return c * x + s * y, c * y - s * x, math.remainder(now.yaw_rad - start.yaw_rad, 2.0 * math.pi)


def turn_wheels(world: World, angles: Sequence[float] | tuple[float, float, float, float]) -> JointStates:
    """Turn the wheels; where the encoders say they have come to."""
    world.command("robot", angles, (4.0,) * 4)
    states = []
    while events := world.advance():
        states += [event for event in events if isinstance(event, JointStates)]
    return states[-1]


def error_percent(found: tuple[float, float, float], expected: tuple[float, float, float]) -> float:
    """Largest difference as a share of the move's length, turns counted at the wheels."""
    scale = (1.0, 1.0, LEVER_M)
    size = math.hypot(*(value * unit for value, unit in zip(expected, scale, strict=True)))
    return 100 * max(abs(a - b) * unit for a, b, unit in zip(found, expected, scale, strict=True)) / size


def kinematics(move: tuple[float, float, float], mode: str, drag: float) -> float:
    """Error of the body's motion against what the wheels have rolled."""
    values = {"motor.drive_mode": mode, "traction.roller_drag": drag}
    world = make_world(make_surface("plane"), 0.89, 0.89, 0.3, **values)
    start = world.ground_truth("robot")
    v, u, turn = move[0], move[1], LEVER_M * move[2]
    final = turn_wheels(world, [d / RADIUS_M for d in (v - u - turn, v + u + turn, v + u - turn, v - u + turn)])
    fl, fr, rl, rr = (RADIUS_M * angle for angle in final.positions[:4])
    rolled = (0.25 * (fl + fr + rl + rr), 0.25 * (-fl + fr + rl - rr), 0.25 * (-fl + fr - rl + rr) / LEVER_M)
    return error_percent(displacement(world, start), rolled)


def calibrated(move: tuple[float, float, float]) -> float:
    """Error of a move by the drive's default calibration, pwm_stop."""
    world, drive = make_world(make_surface("plane"), 0.89, 0.89, 0.3), Drive(DriveParameters())
    start = world.ground_truth("robot")
    action = drive.move(Motion(*move))
    while action.command is not None:
        final = turn_wheels(world, action.command.angles_rad)
        action = drive.joint_states(final.stamp_ns, final.positions, final.velocities)
    return error_percent(displacement(world, start), move)


def drift_mm(surface: Surface, x: float, y: float, heading: float, seconds: int, **values: float) -> float:
    """How far a robot without commands moves, millimetres."""
    world = make_world(surface, x, y, heading, **WATCHED, **values)
    start = world.ground_truth("robot")
    world.request_frames("robot", RATE_HZ * seconds)
    while world.advance():
        pass
    return 1000 * math.hypot(*displacement(world, start)[:2])


def main() -> int:
    head = ("pid, no drag", "pid", "pwm_stop, no drag", "pwm_stop", "pwm_stop, calibrated")
    print("error on the plane, % of the move\n" + " " * 15 + "".join(f"{name:>21}" for name in head))
    for name, move in MOVES.items():
        errors = [kinematics(move, mode, drag) for mode in ("pid", "pwm_stop") for drag in (0.0, 0.02)]
        print(f"{name:15}" + "".join(f"{value:21.3f}" for value in (*errors, calibrated(move))))
    print("\ndrift in 5 s on 14 deg, mm, by friction over the limit 2 tan(slope) max|cos(angle +- 45 deg)|")
    shares = (0.9, 0.97, 1.03, 1.1)
    print("  uphill to forward    limit" + "".join(f"{share:10.2f}" for share in shares))
    plane = make_surface("inclined_plane", {"slope_deg": 14.0, "direction_deg": 90.0})
    for angle in (0.0, 22.5, 45.0, 90.0):
        diagonal = max(abs(math.cos(math.radians(angle + side))) for side in (-45.0, 45.0))
        limit = 2.0 * math.tan(math.radians(14.0)) * diagonal
        drifts = [
            drift_mm(plane, 0.89, 0.89, math.radians(90.0 - angle), 5, **{"traction.friction": share * limit})
            for share in shares
        ]
        print(f"  {angle:13.1f} deg {limit:8.3f}" + "".join(f"{drift:10.3f}" for drift in drifts))
    creep = drift_mm(plane, 0.89, 0.89, 0.5 * math.pi, 60)
    print(f"\ncreep in 60 s on 14 deg, friction 0.45, without sleep: {creep:.4f} mm")
    print("creep in 60 s at the steepest place 30 cm from the edge, uphill along v:")
    for name in sorted(SURFACES):
        surface = make_surface(name)
        ticks = np.linspace(0.3, surface.size_m - 0.3, 25).tolist()
        x, y = max(((x, y) for x in ticks for y in ticks), key=lambda at: math.hypot(*surface.gradient(*at)))
        slope_x, slope_y = surface.gradient(x, y)
        slope = math.degrees(math.atan(math.hypot(slope_x, slope_y)))
        drift = drift_mm(surface, x, y, math.atan2(slope_y, slope_x), 60)
        print(f"  {name:15} {slope:5.1f} deg {drift:9.4f} mm")
    return 0


if __name__ == "__main__":
    sys.exit(main())
