"""Calibrations on simulated robots: what is measured is true, and a calibrated robot drives what it is told to."""

import math
from typing import Any

import numpy as np
import pytest

from robot_formation.calibration.encoder_comparison import Travelled, compare_distances
from robot_formation.calibration.encoder_moves import measure_encoders
from robot_formation.calibration.motor_moves import calibrate_motors, calibrate_robot, preset_rotations
from robot_formation.calibration.rig import CalibrationRig, RobotOnRig
from robot_formation.drive.curves import CalibrationError
from robot_formation.drive.movement_system import CalibrationParameters, Drive, DriveParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.surface import make_surface
from world_helpers import IDEAL, parameters

pytestmark = pytest.mark.slow

DRIVE = DriveParameters()
RADIUS = DRIVE.wheel_radius_m


def rig(
    surface: str = "plane", *, seed: int = 0, noise: float = 0.0, size_m: float = 1.78, **values: Any
) -> CalibrationRig:
    return CalibrationRig(make_surface(surface, {"size_m": size_m}), parameters(**values), seed, noise)


def mean_of_commands(robot: RobotOnRig, curves: CalibrationParameters, commands: int = 40) -> float:
    """Mean distance of repeated 5 cm commands, mm."""
    drive = Drive(DriveParameters(calibration=curves))
    return float(np.mean([robot.move(drive, Motion(x_m=0.05))[0].distance_m for _ in range(commands)])) * 1e3


def test_a_calibrated_robot_drives_5_cm_on_average_and_the_default_curve_does_not() -> None:
    odd = {"rolling_radius": 0.1}  # one curve for all robots is visibly wrong for these
    with RobotOnRig(rig(seed=7, size_m=40.0, imperfections=odd), "follower_1") as robot:
        fits = calibrate_robot(robot, DRIVE, 3)
        own = CalibrationParameters(**{axis: fit.curve for axis, fit in fits.items()})
        assert abs(mean_of_commands(robot, own) - 50.0) < 1.0
        assert abs(mean_of_commands(robot, DRIVE.calibration) - 50.0) > 1.0
        geometry = CalibrationParameters(v=(0.0, 1.0 / RADIUS))
        assert abs(mean_of_commands(robot, geometry) - 50.0) > 1.0


def test_the_curves_of_ideal_robots_are_those_of_the_configuration() -> None:
    fits = calibrate_motors(rig(imperfections=IDEAL["imperfections"]), ["leader", "follower_1"], DRIVE, 1)
    assert {robot: list(axes) for robot, axes in fits.items()} == {
        "leader": ["v", "turn"],
        "follower_1": ["v", "u", "turn"],
    }
    for axes in fits.values():
        for axis, fit in axes.items():
            default = getattr(DRIVE.calibration, axis)
            for point in fit.points:
                asked = (point.rotation_rad - default[0]) / default[1]
                assert point.travel == pytest.approx(asked, abs=2e-3)  # 2 mm; turns 2 mrad


def test_the_same_course_gives_the_same_curves_whichever_robots_are_measured_beside() -> None:
    alone = calibrate_motors(rig(seed=7), ["follower_1"], DRIVE, 1)
    both = calibrate_motors(rig(seed=7), ["leader", "follower_1"], DRIVE, 1)
    assert alone["follower_1"] == both["follower_1"]
    other = calibrate_motors(rig(seed=8), ["follower_1"], DRIVE, 1)
    assert other["follower_1"]["v"].curve != alone["follower_1"]["v"].curve


def test_preset_rotations_cover_the_range_of_the_drive() -> None:
    assert preset_rotations("v", DRIVE)[-1] * RADIUS == pytest.approx(DRIVE.max_v_m)
    assert preset_rotations("u", DRIVE)[-1] * RADIUS == pytest.approx(DRIVE.max_u_m)
    turned = preset_rotations("turn", DRIVE)[-1] * RADIUS / DRIVE.wheel_lever_m
    assert turned == pytest.approx(DRIVE.max_turn_rad)


@pytest.mark.parametrize(("axis", "amount"), [("v", 0.1), ("u", 0.1), ("turn", 0.5)])
@pytest.mark.parametrize("sense", [1, -1])
def test_an_ideal_robot_goes_the_way_of_its_wheels(axis: str, amount: float, sense: int) -> None:
    lever = DRIVE.wheel_lever_m if axis == "turn" else 1.0
    with RobotOnRig(rig(imperfections=IDEAL["imperfections"], motor={"drive_mode": "pid"}), "follower_1") as robot:
        seen = robot.turn_wheels(axis, sense * amount * lever / RADIUS, 4.0)
    travel = seen.turn_rad if axis == "turn" else math.copysign(seen.distance_m, sense)
    assert travel == pytest.approx(sense * amount, rel=0.02)
    assert [abs(angle) for angle in seen.wheels_rad] == pytest.approx([amount * lever / RADIUS] * 4, rel=0.01)


def test_the_observers_error_shows_in_the_scatter() -> None:
    # Each distance is the difference of two readings along the way: sqrt(2) of the error of one.
    with RobotOnRig(rig(imperfections=IDEAL["imperfections"], noise=0.01), "leader") as robot:
        seen = [robot.turn_wheels("v", sense * 3.0, 12.0).distance_m for _ in range(30) for sense in (1, -1)]
    assert np.std(seen) == pytest.approx(0.01 * math.sqrt(2), rel=0.25)


def test_a_robot_that_leaves_the_plate_ends_the_measurement() -> None:
    with (
        RobotOnRig(rig(size_m=0.3), "leader") as robot,
        pytest.raises(CalibrationError, match="left the plate"),
    ):
        robot.turn_wheels("v", 10.0, 4.0)


def test_a_move_beyond_the_range_ends_the_measurement() -> None:
    with RobotOnRig(rig(), "leader") as robot, pytest.raises(CalibrationError, match="beyond"):
        robot.move(Drive(DRIVE), Motion(x_m=0.5))


def test_a_drive_that_takes_too_long_ends_the_measurement() -> None:
    with (
        RobotOnRig(rig(motion_timeout_s=0.2), "leader") as robot,
        pytest.raises(CalibrationError, match="didn't finish"),
    ):
        robot.turn_wheels("v", 10.0, 4.0)


def test_the_instruments_agree_to_a_pulse_and_the_wheels_error() -> None:
    flaws = {"encoder_wheel_radius": 0.01}
    measured = measure_encoders(rig(seed=1, imperfections=flaws), "follower_1", DRIVE, 1)
    assert {drive.axis for drive in measured} == {"v", "u"}
    pulse = 2.0 * math.pi * 0.019 / 512
    for axis in ("v", "u"):
        rows = [row for row in compare_distances(measured) if row.axis == axis]
        assert len(rows) == 10
        assert all(row.drives == 2 for row in rows)
        scale = rows[-1].difference.mean  # the wheel's own radius error, the same at every distance
        assert abs(scale) < 0.04
        for drive in (drive for drive in measured if drive.axis == axis):
            assert drive.sensing_m == pytest.approx(drive.reference_m * (1.0 + scale), abs=3.0 * pulse)
            assert drive.motor_m == pytest.approx(drive.reference_m, rel=0.02, abs=1e-3)
            assert drive.reference_m == pytest.approx(drive.preset_m, abs=8e-3)


def test_drives_are_summarised_by_axis_and_preset() -> None:
    drives = [Travelled("v", 0.1, 0.1, 0.101, 0.1), Travelled("v", 0.1, 0.1, 0.103, 0.1)]
    drives.append(Travelled("u", 0.1, 0.1, 0.09, 0.1))
    rows = compare_distances(drives)
    assert [(row.axis, row.drives) for row in rows] == [("v", 2), ("u", 1)]
    assert rows[0].difference.mean == pytest.approx(0.02)
    assert rows[0].difference.std == pytest.approx(math.sqrt(2) * 0.01)
    assert rows[1].difference.mean == pytest.approx(-0.1)
    assert rows[1].difference.std == 0.0
