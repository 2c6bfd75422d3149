"""Errors, gaps and touches between the ends of timesteps, against courses whose truth is known."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.in_motion import APART_M, TOUCH_M, Course, motion_totals, touches
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Stamped, Track
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import load_track, override
from robot_formation.geometry.se2 import Motion
from robot_formation.json_values import JsonObject
from robot_formation.launching.processes import run_metadata

RATE_S = 0.05
STEP_M, MOVE_S = 0.05, 1.0


def seconds(time_s: float) -> int:
    return round(1e9 * time_s)


def track(x_m: float, moves: list[tuple[float, float]], end_s: float, tilt: float = 0.0) -> Track:
    """A robot at x_m that looks along y: it begins moves of some lengths at some times, and is silent else.

    Each takes a second, and half of its way is driven in the last quarter of that.
    """
    stamps, ys = [0], [0.0]
    for begin_s, distance_m in moves:
        start_m = ys[-1]
        for tick in range(1, round(MOVE_S / RATE_S) + 1):
            share = tick * RATE_S / MOVE_S
            done = share / 1.5 if share <= 0.75 else 0.5 + 2.0 * (share - 0.75)
            stamps.append(seconds(begin_s + tick * RATE_S))
            ys.append(start_m + distance_m * done)
    stamps.append(seconds(end_s))
    ys.append(ys[-1])
    count = len(stamps)
    positions = np.column_stack([np.full(count, x_m), ys, np.zeros(count)])
    return Track(np.array(stamps), positions, np.full(count, 0.5 * math.pi), np.tile([tilt, 0.0], (count, 1)))


def totals(
    leader: list[float], follower: list[float], reports: list[float], *, delayed: bool = False, first_m: float = STEP_M
) -> JsonObject:
    """Measures of a follower 32 cm to the right; robots begin their steps at these times, and it reports at others."""
    tracks = {
        "leader": track(1.0, [(begin, STEP_M) for begin in leader], 100.0),
        "follower_1": track(1.32, [(follower[0], first_m), *((begin, STEP_M) for begin in follower[1:])], 100.0),
    }
    step = Motion(STEP_M)
    record = RunRecord(
        tuple(Stamped(seconds(begin + MOVE_S), step) for begin in leader),
        (
            FollowerRecord(
                "follower_1",
                moved=tuple(Stamped(seconds(begin + MOVE_S), step) for begin in follower),
                displacements=tuple(Stamped(seconds(report), step) for report in reports),
            ),
        ),
        tracks,
        details={"parameters": json.dumps({"fine_tuner": {"spacing": "delayed" if delayed else "rigid"}})},
    )
    return motion_totals(record, record.followers[0])


def test_a_follower_that_waits_for_its_neighbours_step_is_a_step_behind_meanwhile() -> None:
    found = totals([10.0, 20.0, 30.0], [12.0, 22.0, 32.0], [14.0, 24.0, 34.0])
    assert found["formation_error_moving_max_m"] == pytest.approx(STEP_M)
    assert found["gap_min_m"] == pytest.approx(0.32 - 0.238)
    assert found["touches"] == 0


def test_robots_that_move_at_the_same_time_keep_their_places() -> None:
    found = totals([10.0, 20.0, 30.0], [10.0, 20.0, 30.0], [13.0, 23.0, 33.0])
    assert found["formation_error_moving_max_m"] == pytest.approx(0.0, abs=1e-12)


def test_half_a_second_late_is_what_the_neighbour_has_driven_by_then() -> None:
    found = totals([10.0, 20.0], [10.5, 20.5], [13.0, 23.0])
    assert found["formation_error_moving_max_m"] == pytest.approx(2.0 / 3.0 * STEP_M)


@pytest.mark.parametrize("shift_s", [0.0, 0.7])
def test_the_delayed_place_moves_as_the_neighbour_did_in_its_timestep(shift_s: float) -> None:
    """The first timesteps are longer than the later ones, and the follower may begin its own at another time."""
    leader = [16.0, 32.0, 48.0, 52.0, 56.0]
    follower = [begin + shift_s for begin in leader]
    reports = [begin + 2.5 for begin in leader]
    found = totals(leader, follower, reports, delayed=True, first_m=0.0)
    assert found["formation_error_moving_max_m"] == pytest.approx(0.0, abs=1e-12)


def test_a_delayed_follower_that_keeps_up_is_a_step_ahead_of_its_place() -> None:
    leader = [16.0, 32.0, 48.0]
    found = totals(leader, leader, [begin + 2.5 for begin in leader], delayed=True)
    assert found["formation_error_moving_max_m"] == pytest.approx(STEP_M)


def test_without_ground_truth_nothing_is_known() -> None:
    follower = FollowerRecord("follower_1")
    found = motion_totals(RunRecord((), (follower,)), follower)
    assert set(found.values()) == {None}


def test_without_a_report_there_is_no_error_but_there_are_gaps() -> None:
    tracks = {"leader": track(1.0, [], 5.0), "follower_1": track(1.238, [], 5.0)}
    follower = FollowerRecord("follower_1")
    found = motion_totals(RunRecord((), (follower,), tracks), follower)
    assert found == {
        "formation_error_moving_max_m": None,
        "gap_min_m": pytest.approx(0.0, abs=1e-12),
        "touches": 1,
    }


def test_robots_tilted_towards_each_other_are_nearer_at_their_tops() -> None:
    tracks = {"leader": track(1.0, [], 5.0, tilt=0.05), "follower_1": track(1.32, [], 5.0, tilt=-0.03)}
    follower = FollowerRecord("follower_1")
    run = RunRecord((), (follower,), tracks, details={"parameters": '{"world": {"chassis.body_top_m": 0.2}}'})
    assert motion_totals(run, follower)["gap_min_m"] == pytest.approx(0.32 - 0.238 - 0.2 * 0.08)
    away = {"leader": track(1.0, [], 5.0, tilt=-0.05), "follower_1": track(1.32, [], 5.0, tilt=0.03)}
    assert motion_totals(RunRecord((), (follower,), away), follower)["gap_min_m"] == pytest.approx(0.32 - 0.238)


def test_a_course_stands_through_pauses_and_moves_evenly_between_entries() -> None:
    course = Course.of(track(1.0, [(10.0, 0.06)], 20.0), RATE_S)
    stamps = np.array([seconds(time) for time in (0.0, 9.99, 10.025, 10.75, 11.0, 15.0)])
    assert course.at(stamps)[:, 1] == pytest.approx([0.0, 0.0, 0.001, 0.03, 0.06, 0.06])
    assert np.isnan(course.at(np.array([-1]))).all()
    assert course.begin_ns(seconds(5.0), seconds(15.0)) == seconds(10.0)
    assert course.begin_ns(seconds(5.0), seconds(9.0)) is None


@given(st.lists(st.sampled_from([-0.01, 0.0, TOUCH_M, 0.003, APART_M, 0.1]), max_size=30))
def test_touches_are_counted_once_until_the_bodies_are_apart_again(gaps: list[float]) -> None:
    """As many as there are stretches between gaps of 5 mm that hold one below a millimetre."""
    stretches: list[list[float]] = [[]]
    for gap in gaps:
        if gap >= APART_M:
            stretches.append([])
        else:
            stretches[-1].append(gap)
    assert touches(np.array(gaps)) == sum(min(stretch, default=1.0) <= TOUCH_M for stretch in stretches)


def test_a_bag_and_a_run_in_memory_have_the_same_totals(tmp_path: Path) -> None:
    """Tilted bodies, places of an echelon and all else: whatever way the messages have come."""
    settings = ["formation=echelon", "start_y_m=0.3", "leader.timesteps=3", "world.camera.mode=on_demand"]
    scenario = override(load_track("one"), settings)
    in_memory = analyse(run_in_memory(scenario)).followers[0].totals
    run_in_process(scenario, tmp_path / "bag", run_metadata(scenario))
    recorded = analyse(load_run(tmp_path / "bag")).followers[0].totals
    for name in ("formation_error_rmse_m", "formation_error_moving_max_m", "gap_min_m", "touches"):
        assert recorded[name] == in_memory[name]
    # In motion the neighbour is a step ahead; the place that an echelon has is not an error.
    assert in_memory["formation_error_moving_max_m"] < 0.075
