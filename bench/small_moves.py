"""What robots make of small moves: short legs aside and turns on slopes, which the precise mode's step models assume.

Prints the mean and the standard deviation, over robots, of what each move led ahead and aside [mm] and turned [deg]. A
robot stands alone on an inclined plane that rises to its left.

    python bench/small_moves.py [--robots 6] [--slopes 0,4,8]
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from robot_formation.calibration.rig import CalibrationRig, RobotOnRig
from robot_formation.drive.movement_system import Drive
from robot_formation.experiment.scenario import Scenario, load_track, override, with_surface
from robot_formation.geometry.se2 import Motion

STEP_M, TURN_RAD = 0.05, math.radians(8.0)
MOVES = {
    "ahead 50 mm": Motion(STEP_M),
    "back 50 mm": Motion(-STEP_M),
    **{f"left {1e3 * way:.1f} mm": Motion(0.0, way) for way in (0.0025, 0.0035, 0.005, 0.008, 0.02)},
    **{f"right {1e3 * way:.1f} mm": Motion(0.0, -way) for way in (0.0035, 0.005)},
    "turn by 5 deg": Motion(yaw_rad=math.radians(5.0)),
    "turn by 8 deg": Motion(yaw_rad=TURN_RAD),
    "arc, 8 deg left": Motion(STEP_M, STEP_M * math.tan(0.5 * TURN_RAD), TURN_RAD),
    "arc, 8 deg right": Motion(STEP_M, -STEP_M * math.tan(0.5 * TURN_RAD), -TURN_RAD),
}


def moved(scenario: Scenario, seed: int, motion: Motion) -> tuple[float, float, float]:
    """Let one robot make a move; return where it went: ahead, to the left [mm], turn [deg]."""
    rig = CalibrationRig(scenario.world.make_surface(), scenario.world, seed)
    with RobotOnRig(rig, "leader") as robot:
        seen, _ = robot.move(Drive(scenario.drive), motion)
    return 1e3 * seen.way_m[0], 1e3 * seen.way_m[1], math.degrees(seen.turn_rad)


def main() -> None:
    """Print a table for each slope."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=6, help="how many robots, each of its own seed")
    parser.add_argument("--slopes", default="0,4,8", help="slopes of the ground, degrees")
    args = parser.parse_args()
    for slope in args.slopes.split(","):
        ground = f"world.surface_parameters=[slope_deg={slope}, direction_deg=90]"
        scenario = override(with_surface(load_track("one"), "inclined_plane"), [ground])
        print(f"\nslope {slope} deg        ahead mm      left mm      turn deg")
        for name, motion in MOVES.items():
            found = np.array([moved(scenario, seed, motion) for seed in range(args.robots)])
            cells = (f"{m:6.2f} +- {s:4.2f}" for m, s in zip(found.mean(0), found.std(0), strict=True))
            print(f"{name:18}", *cells)


if __name__ == "__main__":
    main()
