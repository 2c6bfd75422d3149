import math
from typing import Any

import pytest

from robot_formation.names import JOINTS
from robot_formation.world.events import JointStates, RobotPose
from robot_formation.world.start import RobotStart
from world_helpers import IDEAL, PAIR, SPEEDS, STRAIGHT, displacement, of_kind, run, world

ALONE = (RobotStart("leader", 0.89, 0.89, 0.3, camera=False),)
RADIUS = 0.030
ARM = 0.110 + 0.095


def wheel_angles(v_x: float, v_y: float, turn: float) -> tuple[float, ...]:
    across = ARM * turn
    return tuple(
        value / RADIUS for value in (v_x - v_y - across, v_x + v_y + across, v_x + v_y - across, v_x - v_y + across)
    )


@pytest.mark.parametrize(
    ("v_x", "v_y", "turn"), [(0.2, 0, 0), (-0.2, 0, 0), (0, 0.1, 0), (0.1, 0.1, 0), (0, 0, 0.6), (0, 0, -0.6)]
)
def test_an_ideal_robot_on_level_ground_follows_mecanum_kinematics(v_x: float, v_y: float, turn: float) -> None:
    with_ideal_rollers: dict[str, Any] = {"motor": {"drive_mode": "pid"}, "traction": {"roller_drag": 0.0}, **IDEAL}
    a_world = world(robots=ALONE, **with_ideal_rollers)
    start = a_world.ground_truth("leader")
    a_world.command("leader", wheel_angles(v_x, v_y, turn), (4.0,) * 4)
    run(a_world)
    moved = displacement(a_world, "leader", start)
    scale = math.hypot(v_x, v_y) + ARM * abs(turn)
    assert moved[:2] == pytest.approx((v_x, v_y), abs=0.005 * scale)
    assert moved[2] == pytest.approx(turn, abs=0.005 * scale / ARM)


def test_roller_drag_costs_little_and_only_off_the_forward_direction() -> None:
    a_world = world(robots=ALONE, motor={"drive_mode": "pid"}, **IDEAL)
    start = a_world.ground_truth("leader")
    a_world.command("leader", wheel_angles(0.2, 0, 0), (4.0,) * 4)
    run(a_world)
    assert displacement(a_world, "leader", start)[0] == pytest.approx(0.2, rel=0.002)
    start = a_world.ground_truth("leader")
    a_world.command("leader", wheel_angles(0, 0.1, 0), (4.0,) * 4)
    run(a_world)
    assert displacement(a_world, "leader", start)[1] == pytest.approx(0.1, rel=0.01)


def test_pwm_stop_overshoots_on_the_level_and_more_downhill_than_uphill() -> None:
    def forward(surface: str, heading: float) -> float:
        a_world = world(surface, (RobotStart("leader", 0.89, 1.7, heading, camera=False),), **IDEAL)
        start = a_world.ground_truth("leader")
        a_world.command("leader", wheel_angles(0.05, 0, 0), SPEEDS)
        run(a_world)
        return displacement(a_world, "leader", start)[0]

    level, up, down = forward("plane", 0.0), forward("bowl", math.pi / 2), forward("bowl", -math.pi / 2)
    assert 0.050 < level < 0.055
    assert up < level - 0.003
    assert down > level + 0.003


def test_a_standing_robot_does_not_creep_on_the_steepest_slope() -> None:
    corner = (RobotStart("leader", 0.08, 0.08, 1.0),)
    a_world = world("bowl", corner, sleep=False, camera={"mode": "on_demand"})
    start = a_world.ground_truth("leader")
    a_world.request_frames("leader", 60)
    run(a_world)
    assert a_world.stamp_ns == 2 * 10**9
    moved = displacement(a_world, "leader", start)
    assert math.hypot(*moved[:2]) < 5e-5
    assert abs(moved[2]) < 1e-4


def test_a_robot_slides_when_friction_is_below_the_hold_limit() -> None:
    corner = (RobotStart("leader", 0.15, 0.15, 1.0),)
    a_world = world("bowl", corner, sleep=False, camera={"mode": "on_demand"}, traction={"friction": 0.15})
    start = a_world.ground_truth("leader")
    a_world.request_frames("leader", 15)
    run(a_world)
    now = a_world.ground_truth("leader")
    assert now.x_m - start.x_m > 0.02
    assert now.y_m - start.y_m > 0.02


@pytest.mark.parametrize("surface", ["plane", "bowl"])
def test_robots_start_at_rest_exactly_where_they_were_asked_to(surface: str) -> None:
    a_world = world(surface)
    assert (a_world.step_count, a_world.stamp_ns) == (0, 0)
    for robot in PAIR:
        state = a_world.ground_truth(robot.name)
        assert (state.x_m, state.y_m) == pytest.approx((robot.x_m, robot.y_m), abs=1e-4)
        assert state.yaw_rad == pytest.approx(robot.heading_rad, abs=1e-4)
        assert state.z_m == pytest.approx(a_world.surface.height(robot.x_m, robot.y_m), abs=0.004)
        assert (state.linear_m_s, state.angular_rad_s) == ((0.0,) * 3, (0.0,) * 3)


def test_only_the_last_joint_states_of_a_motion_have_no_velocity() -> None:
    a_world = world()
    a_world.command("leader", STRAIGHT, SPEEDS)
    events = run(a_world)
    states = of_kind(events, JointStates, "leader")
    assert len(states) > 3
    assert all(state.names == JOINTS for state in states)
    assert [any(state.velocities) for state in states] == [True] * (len(states) - 1) + [False]
    assert [state.final for state in states] == [False] * (len(states) - 1) + [True]
    assert states[-1].stamp_ns == a_world.stamp_ns
    assert not states[-1].timed_out
    last_pose = of_kind(events, RobotPose, "leader")[-1]
    assert last_pose.final
    assert last_pose.state == a_world.ground_truth("leader")


def test_encoder_wheels_measure_the_displacement_and_count_from_the_start() -> None:
    a_world = world(robots=ALONE, **IDEAL)
    start = a_world.ground_truth("leader")
    a_world.command("leader", wheel_angles(0.1, 0.05, 0), (4.0, 4.0, 4.0, 4.0))
    final = of_kind(run(a_world), JointStates)[-1]
    forward, left, turn = displacement(a_world, "leader", start)
    assert abs(turn) < 0.02
    assert final.positions[4] * 0.019 == pytest.approx(forward, abs=0.002)
    assert final.positions[5] * 0.019 == pytest.approx(left, abs=0.002)
    pulse = 2 * math.pi / 512
    assert final.positions[4] / pulse == pytest.approx(round(final.positions[4] / pulse), abs=1e-6)


def test_a_zero_command_brakes_a_running_motion() -> None:
    a_world = world()
    a_world.command("leader", (20.0,) * 4, SPEEDS)
    for _ in range(4):
        a_world.advance()
    a_world.command("leader", (0.0,) * 4, (0.0,) * 4)
    final = of_kind(run(a_world), JointStates)[-1]
    assert final.final
    assert 0.0 < final.positions[0] < 5.0


def test_a_stalled_motion_is_finished_and_says_so() -> None:
    a_world = world(motion_timeout_s=0.5)
    a_world.command("leader", (100.0,) * 4, SPEEDS)
    final = of_kind(run(a_world), JointStates)[-1]
    assert final.final
    assert final.timed_out
    assert 0.5 <= final.stamp_ns * 1e-9 < 1.6


def test_a_sleeping_robot_wakes_when_it_is_hit() -> None:
    robots = (RobotStart("leader", 0.5, 0.5, 0.0, camera=False), RobotStart("follower_1", 0.9, 0.5, 0.0, camera=False))
    a_world = world(robots=robots)
    a_world.command("leader", (4.0,) * 4, SPEEDS)
    events = run(a_world)
    assert a_world.ground_truth("follower_1").x_m > 0.93
    assert of_kind(events, JointStates, "follower_1")[-1].final
    assert not a_world.owes
