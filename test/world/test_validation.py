"""The world against closed-form truth: mecanum kinematics on level ground, statics and energy on slopes."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from robot_formation.drive.movement_system import Drive, DriveParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.surface import SURFACES, Surface, make_surface
from robot_formation.world.events import BodyState, JointStates
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World
from world_helpers import IDEAL, SPEEDS, displacement, of_kind, parameters, run, world

pytestmark = pytest.mark.slow

ALONE = (RobotStart("leader", 0.89, 0.89, 0.3, camera=False),)
RADIUS, ARM = 0.030, 0.110 + 0.095
MOVES = [(0.2, 0, 0), (-0.2, 0, 0), (0, 0.1, 0), (0, -0.1, 0), (0.1, 0.1, 0), (0.1, -0.1, 0), (0, 0, 0.6), (0, 0, -0.6)]
DRIVE_MODES = ["pid", "pwm_stop"]
# A clock for worlds in which nobody moves: frames that cost nothing.
RATE_HZ = 2
WATCHED = {
    "sleep": False,
    "camera": {"mode": "on_demand", "min_frames_per_second": RATE_HZ, "width_px": 16, "height_px": 16},
}


def wheel_angles(v_x: float, v_y: float, turn: float) -> tuple[float, ...]:
    across = ARM * turn
    return tuple(d / RADIUS for d in (v_x - v_y - across, v_x + v_y + across, v_x + v_y - across, v_x - v_y + across))


def rolled(angles: Sequence[float]) -> tuple[float, float, float]:
    """Displacement of a mecanum base whose wheels have turned so far, in proportion: forward, left, turn."""
    front_left, front_right, rear_left, rear_right = (RADIUS * angle for angle in angles)
    return (
        0.25 * (front_left + front_right + rear_left + rear_right),
        0.25 * (-front_left + front_right + rear_left - rear_right),
        0.25 * (-front_left + front_right - rear_left + rear_right) / ARM,
    )


def error(found: tuple[float, float, float], expected: tuple[float, float, float], scale: float) -> float:
    """Largest difference over the move's length, a turn counted at the wheels."""
    return max(abs(found[0] - expected[0]), abs(found[1] - expected[1]), ARM * abs(found[2] - expected[2])) / scale


@pytest.mark.parametrize("roller_drag", [0.0, 0.02])
@pytest.mark.parametrize("mode", DRIVE_MODES)
@pytest.mark.parametrize("move", MOVES)
def test_the_body_moves_as_its_wheels_roll_within_half_a_percent(
    mode: str, roller_drag: float, move: tuple[float, float, float]
) -> None:
    a_world = world(robots=ALONE, motor={"drive_mode": mode}, traction={"roller_drag": roller_drag}, **IDEAL)
    start = a_world.ground_truth("leader")
    a_world.command("leader", wheel_angles(*move), SPEEDS)
    angles = of_kind(run(a_world), JointStates)[-1].positions[:4]
    # One encoder count is 0.13 mm.
    scale = math.hypot(*move[:2]) + ARM * abs(move[2])
    assert error(displacement(a_world, "leader", start), rolled(angles), scale) < 0.005


@pytest.mark.parametrize("move", MOVES)
def test_pid_turns_the_wheels_as_commanded_so_the_body_moves_as_asked(move: tuple[float, float, int]) -> None:
    a_world = world(robots=ALONE, motor={"drive_mode": "pid"}, traction={"roller_drag": 0.0}, **IDEAL)
    start = a_world.ground_truth("leader")
    a_world.command("leader", wheel_angles(*move), SPEEDS)
    run(a_world)
    scale = math.hypot(*move[:2]) + ARM * abs(move[2])
    assert error(displacement(a_world, "leader", start), move, scale) < 0.0015


@pytest.mark.parametrize("move", [*MOVES, (0.05, 0, 0), (0, 0.05, 0)])
def test_pwm_stop_with_the_drives_default_calibration_moves_as_asked_within_half_a_percent(
    move: tuple[float, float, int],
) -> None:
    a_world, drive = world(robots=ALONE, **IDEAL), Drive(DriveParameters())
    start = a_world.ground_truth("leader")
    action = drive.move(Motion(*move))
    while action.command is not None:
        a_world.command("leader", action.command.angles_rad, action.command.limits_rad_s)
        final = of_kind(run(a_world), JointStates)[-1]
        action = drive.joint_states(final.stamp_ns, final.positions, final.velocities)
    # Diagonals are driven as two legs, so each axis counts by itself.
    scale = max(abs(move[0]), abs(move[1]), ARM * abs(move[2]))
    assert error(displacement(a_world, "leader", start), move, scale) < 0.005


def hold_limit(slope_deg: float, direction_deg: float) -> float:
    """Least friction that holds a robot with locked wheels, `direction_deg` between uphill and its forward axis.

    The rollers hold along the two diagonals only, each with two of the wheels.
    """
    along = max(abs(math.cos(math.radians(direction_deg + diagonal))) for diagonal in (-45.0, 45.0))
    return 2.0 * math.tan(math.radians(slope_deg)) * along


def moved_after(seconds: int, surface: Surface, start: RobotStart, **values: Any) -> tuple[float, float]:
    """How far and by what angle a robot without commands has moved: metres, radians."""
    a_world = World(surface, [start], parameters(**{**WATCHED, **IDEAL, **values}), seed=1)
    before = a_world.ground_truth(start.name)
    for _ in range(0, seconds, 300):
        a_world.request_frames(start.name, RATE_HZ * seconds)
        run(a_world)
    assert a_world.stamp_ns == seconds * 10**9
    forward, left, turn = displacement(a_world, start.name, before)
    return math.hypot(forward, left), abs(turn)


def on_slope(slope_deg: float, direction_deg: float, friction: float) -> float:
    plane = make_surface("inclined_plane", {"slope_deg": slope_deg, "direction_deg": 90.0})
    start = RobotStart("leader", 0.89, 0.89, math.radians(90.0 - direction_deg))
    return moved_after(5, plane, start, traction={"friction": friction})[0]


@pytest.mark.parametrize("slope_deg", [8.0, 14.0])
@pytest.mark.parametrize("direction_deg", [0.0, 22.5, 45.0, 90.0, 135.0, 180.0, 290.0])
def test_a_robot_holds_above_the_friction_limit_and_slides_below_it(slope_deg: float, direction_deg: float) -> None:
    limit = hold_limit(slope_deg, direction_deg)
    assert on_slope(slope_deg, direction_deg, 1.1 * limit) < 1e-3
    assert on_slope(slope_deg, direction_deg, 0.9 * limit) > 0.05


def test_along_its_axes_a_robot_needs_root_two_times_the_slope_and_on_its_diagonals_twice() -> None:
    slope = math.tan(math.radians(10.0))
    assert [hold_limit(10.0, angle) / slope for angle in (0.0, 90.0)] == pytest.approx([math.sqrt(2.0)] * 2)
    assert [hold_limit(10.0, angle) / slope for angle in (45.0, 135.0)] == pytest.approx([2.0] * 2)


def test_nothing_creeps_in_a_minute_at_14_degrees() -> None:
    plane = make_surface("inclined_plane", {"slope_deg": 14.0})
    for heading in (0.0, 0.5 * math.pi):
        distance, turn = moved_after(60, plane, RobotStart("leader", 0.89, 0.89, heading))
        assert distance < 5e-5
        assert turn < 1e-5


def steepest(surface: Surface) -> tuple[float, float, float]:
    """A steep place well inside the plate, and the direction uphill there."""
    ticks = np.linspace(0.3, surface.size_m - 0.3, 25).tolist()
    x, y = max(((x, y) for x in ticks for y in ticks), key=lambda place: math.hypot(*surface.gradient(*place)))
    slope_x, slope_y = surface.gradient(x, y)
    return x, y, math.atan2(slope_y, slope_x)


@pytest.mark.parametrize("name", sorted(SURFACES))
@pytest.mark.parametrize("aside", [0.0, 0.5 * math.pi])
def test_on_every_surface_a_robot_without_commands_stays_where_it_is(name: str, aside: float) -> None:
    surface = make_surface(name)
    x, y, uphill = steepest(surface)
    distance, turn = moved_after(10, surface, RobotStart("leader", x, y, uphill + aside))
    assert distance < 1e-4
    assert turn < 1e-4


@pytest.mark.parametrize("name", sorted(SURFACES))
def test_on_every_surface_all_four_wheels_carry(name: str) -> None:
    surface = make_surface(name)
    x, y, uphill = steepest(surface)
    for heading in (uphill, uphill + 0.25 * math.pi, uphill + 0.5 * math.pi):
        a_world = World(surface, [RobotStart("leader", x, y, heading)], parameters(**IDEAL), seed=1)
        a_world.command("leader", (2.0,) * 4, SPEEDS)
        # A wheel in the air would spin, and the robot would turn and slide.
        final = of_kind(run(a_world), JointStates)[-1]
        assert max(final.positions[:4]) < 3.0
        state = a_world.ground_truth("leader")
        assert math.hypot(state.x_m - x, state.y_m - y) == pytest.approx(0.06, abs=0.03)
        assert abs(math.remainder(state.yaw_rad - heading, 2.0 * math.pi)) < 0.1


def test_a_wheel_in_the_air_stops_too_when_its_count_is_reached() -> None:
    rigid: dict[str, Any] = {"chassis": {"twist_stiffness_n_m": 4000.0}}
    a_world = world("saddle", (RobotStart("leader", 1.412, 0.111, math.radians(135)),), **rigid)
    a_world.command("leader", (1.6,) * 4, SPEEDS)
    final = of_kind(run(a_world), JointStates)[-1]
    assert not final.timed_out
    assert max(final.positions[:4]) < 3.0


def test_a_sliding_robot_loses_energy_all_the_time() -> None:
    plane = make_surface("inclined_plane", {"slope_deg": 14.0, "direction_deg": 90.0})
    values = parameters(**WATCHED, **IDEAL, traction={"friction": 0.2})
    a_world = World(plane, [RobotStart("leader", 0.89, 1.6, 0.5 * math.pi)], values, seed=1)
    a_world.request_frames("leader", 2 * RATE_HZ)
    energies = []
    while a_world.owes:
        a_world.step()
        state = a_world.ground_truth("leader")
        speed = sum(v * v for v in state.linear_m_s)
        energies.append(1.7 * (9.81 * (state.z_m + 0.05) + 0.5 * speed))
    # Sinking into the bristles and back may hand a little to and fro.
    assert max(np.diff(energies[::24])) < 0.0
    assert energies[-1] < energies[0] - 0.05


def test_ten_robots_move_each_as_if_it_were_alone() -> None:
    starts = [
        RobotStart(f"robot_{n}", 0.25 + 0.32 * (n % 5), 0.45 + 0.6 * (n // 5), 0.5 * math.pi, camera=False)
        for n in range(10)
    ]

    def driven(robots: Sequence[RobotStart]) -> list[BodyState]:
        a_world = world("bowl", robots)
        for turns in (1.6, -1.0):
            for robot in robots:
                a_world.command(robot.name, (turns,) * 4, SPEEDS)
            run(a_world)
        return [a_world.ground_truth(robot.name) for robot in robots]

    together = driven(starts)
    assert together[3:5] == [*driven(starts[3:4]), *driven(starts[4:5])]
    assert all(abs(state.y_m - start.y_m) > 0.005 for state, start in zip(together, starts, strict=True))


def test_robots_that_press_against_each_other_come_to_rest() -> None:
    robots = [RobotStart(f"robot_{n}", 0.4, 0.3 + 0.37 * n, 0.5 * math.pi, camera=False) for n in range(3)]
    a_world = world(robots=robots)
    for turns in (3.0, 3.0, -3.0, 3.0):
        a_world.command("robot_0", (turns,) * 4, SPEEDS)
        a_world.command("robot_2", (-turns,) * 4, SPEEDS)
        run(a_world)
    assert not a_world.owes
    assert a_world.stamp_ns < 140 * 10**9
