"""Distance driven against wheel rotation, as the simulated robots do it: the default calibration, and what it is worth.

Prints the fits of wheel rotation on distance for an ideal robot on the plane (the defaults of config/drive.yaml), the
spread of a calibrated 5 cm move over robots with the default imperfections, and what the bowl makes of one without.

Run: python bench/drive_calibration.py [--robots N]
"""

import argparse
import dataclasses
import math
import sys

import numpy as np

from robot_formation.drive.movement_system import CalibrationParameters, DriveParameters
from robot_formation.parameters import from_mapping, specs
from robot_formation.surface import make_surface
from robot_formation.world.parameters import DriveMode, ImperfectionParameters, WorldParameters
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World

SIGNS = {"v": (1.0, 1.0, 1.0, 1.0), "u": (1.0, -1.0, -1.0, 1.0), "turn": (-1.0, 1.0, -1.0, 1.0)}
UNITS = {"v": ("m", "rad/m"), "u": ("m", "rad/m"), "turn": ("rad", "rad/rad")}
DRIVE = DriveParameters()
LONGEST = {"v": DRIVE.max_v_m, "u": DRIVE.max_u_m, "turn": DRIVE.max_turn_rad}
POINTS = 10
STEP_M = 0.05
MIDDLE_M = 0.89
NEAR_EDGE_M = 1.70
HEADINGS = {"uphill": math.pi / 2, "downhill": -math.pi / 2, "across": 0.0}


def world_parameters(*, ideal: bool, drive_mode: str = "pwm_stop") -> WorldParameters:
    values: dict[str, str | float] = {"motor.drive_mode": drive_mode, "camera.mode": "on_demand"}
    if ideal:
        values.update({f"imperfections.{name}": 0.0 for name in specs(ImperfectionParameters)})
    return from_mapping(WorldParameters, values, where="bench")


def drive(
    surface: str, start: RobotStart, parameters: WorldParameters, angle_rad: float, axis: str, seed: int = 0
) -> dict[str, float]:
    """Turn all wheels by an angle along an axis; displacement (v, u, turn) of base_link in its frame at the start."""
    world = World(make_surface(surface), [start], parameters, seed=seed)
    before = world.ground_truth(start.name)
    world.command(start.name, [sign * angle_rad for sign in SIGNS[axis]], [DRIVE.wheel_speed_rad_s] * 4)
    while world.advance():
        pass
    after = world.ground_truth(start.name)
    world.close()
    dx, dy = after.x_m - before.x_m, after.y_m - before.y_m
    c, s = math.cos(before.yaw_rad), math.sin(before.yaw_rad)
    turn = math.remainder(after.yaw_rad - before.yaw_rad, math.tau)
    return {"v": c * dx + s * dy, "u": s * dx - c * dy, "turn": turn}


def fit(axis: str) -> tuple[float, float, float]:
    """Constant and slope of wheel rotation [rad] on distance, and the largest distance error of the line."""
    parameters = world_parameters(ideal=True)
    start = RobotStart("follower_1", MIDDLE_M, MIDDLE_M, 0.0, camera=False)
    nominal = LONGEST[axis] * (DRIVE.wheel_lever_m if axis == "turn" else 1.0) / DRIVE.wheel_radius_m
    angles = np.linspace(nominal / POINTS, nominal, POINTS)
    driven = np.array([drive("plane", start, parameters, angle, axis)[axis] for angle in angles])
    slope, constant = np.polyfit(driven, angles, 1)
    return constant, slope, np.abs((angles - constant) / slope - driven).max()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=100, help="robots (seeds) of the spread (default: 100)")
    robots = max(2, parser.parse_args().robots)
    print(f"plane, no imperfections, {DRIVE.wheel_speed_rad_s:g} rad/s: wheel rotation = constant + slope x distance")
    defaults = dataclasses.asdict(CalibrationParameters())
    for axis in SIGNS:
        constant, slope, error = fit(axis)
        unit, slope_unit = UNITS[axis]
        said = ", ".join(f"{value:g}" for value in defaults[axis])
        print(
            f"  {axis:4}  {constant:7.4f} rad  {slope:8.4f} {slope_unit:7}  largest error of the line "
            f"{error * 1e3:.2f} m{unit}, default {said}"
        )
    parameters = world_parameters(ideal=False)
    start = RobotStart("follower_1", MIDDLE_M, MIDDLE_M, 0.0, camera=False)
    angle = defaults["v"][0] + defaults["v"][1] * STEP_M
    driven = [drive("plane", start, parameters, angle, "v", seed)["v"] * 1e3 for seed in range(robots)]
    print(f"plane, default imperfections, calibrated {STEP_M * 1e3:g} mm along v, {robots} robots:")
    print(f"  mean {np.mean(driven):.2f} mm, standard deviation {np.std(driven, ddof=1):.2f} mm")
    gradient = make_surface("bowl").gradient(MIDDLE_M, NEAR_EDGE_M)
    slope_deg = math.degrees(math.atan(math.hypot(*gradient)))
    print(f"bowl at ({MIDDLE_M}, {NEAR_EDGE_M}) m, slope {slope_deg:.1f} deg, no imperfections, wheels turned")
    print(
        f"  by {STEP_M * 1e3:g} mm of rolling without calibration; driven along v, and to the lower side when across:"
    )
    for mode in DriveMode:
        ideal = world_parameters(ideal=True, drive_mode=mode)
        moved = {
            name: drive(
                "bowl",
                RobotStart("follower_1", MIDDLE_M, NEAR_EDGE_M, heading, camera=False),
                ideal,
                STEP_M / DRIVE.wheel_radius_m,
                "v",
            )
            for name, heading in HEADINGS.items()
        }
        print(
            f"  {mode:8}  uphill {moved['uphill']['v'] * 1e3:.1f} mm, downhill {moved['downhill']['v'] * 1e3:.1f} mm, "
            f"across {moved['across']['v'] * 1e3:.1f} mm with {moved['across']['u'] * 1e3:.1f} mm of side drift"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
