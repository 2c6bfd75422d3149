"""Whole runs by each schedule, in process: who waits for whom, what it costs in time, and what lags."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from robot_formation import conversions
from robot_formation.analysis.chain import moves_of_timestep
from robot_formation.analysis.quantities import RunAnalysis, analyse
from robot_formation.analysis.run_record import RunRecord
from robot_formation.errors import FormationError
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.scenario import Scenario, load, load_track, override, presets
from robot_formation.geometry.se2 import Motion
from robot_formation.schedule.schedules import begin_s

pytestmark = pytest.mark.xdist_group("schedules")

GROUND = (
    "world.surface_parameters=[size_m=2.6, curvature_per_m=0.06]",
    "start_x_m=0.82",
    "start_y_m=0.9",
    "world.camera.mode=on_demand",
    "world.overhead.enabled=false",
    "followers=2",
    "leader.timesteps=6",
    "seed=5",
)


def scenario(*settings: str) -> Scenario:
    return override(load_track("one"), [*GROUND, *settings])


@cache
def record(*settings: str) -> RunRecord:
    return run_in_memory(scenario(*settings))


@cache
def analysed(*settings: str) -> RunAnalysis:
    return analyse(record(*settings))


@pytest.mark.parametrize("settings", [("schedule=wave",), ("schedule=together",), ("schedule=timer",)])
def test_every_schedule_keeps_the_formation(settings: tuple[str, ...]) -> None:
    found = analysed(*settings)
    assert found.outcome == "done"
    for follower in found.followers:
        assert follower.totals["timesteps_finished"] == 6
        assert follower.totals["formation_error_rmse_m"] < 0.02


def test_a_wave_gives_the_first_follower_the_run_of_turns() -> None:
    """Every look is at a standing robot: but for when they happen, the first follower's timesteps are the same."""
    turns, wave = (record(f"schedule={name}").followers[0] for name in ("turns", "wave"))
    for ours, theirs in zip(turns.displacements, wave.displacements, strict=True):
        assert np.allclose((ours.motion.x_m, ours.motion.y_m), (theirs.motion.x_m, theirs.motion.y_m), atol=0.005)


def test_moving_at_once_takes_less_time_than_turns() -> None:
    turns, together = (record(f"schedule={name}").simulated_s for name in ("turns", "together"))
    assert together < 0.8 * turns


def test_the_timer_has_no_ticks() -> None:
    heard: set[str] = set()
    code, _ = InProcessRun(scenario("schedule=timer"), listen=lambda name, message: heard.add(name)).run()
    assert code == 0
    assert not [name for name in heard if name.startswith("/formation/")]


def test_the_clock_is_rare_with_the_timer_but_tells_the_end_of_each_period() -> None:
    told: dict[str, list[int]] = {"turns": [], "timer": []}
    for schedule, stamps in told.items():
        InProcessRun(
            scenario(f"schedule={schedule}"),
            listen=lambda name, message, into=stamps: into.append(conversions.read_clock(message)),  # type: ignore[misc]
            heard={"/clock"},
        ).run()
    assert min(later - earlier for earlier, later in pairwise(told["turns"])) < 10**8
    ends = {round(1e9 * begin_s(timestep, scenario("schedule=timer").leader.period_s)) for timestep in range(1, 5)}
    assert ends <= set(told["timer"])
    ends |= {round(1e9 * begin_s(timestep, scenario("schedule=timer").leader.period_s)) for timestep in (5, 6, 7)}
    others = [stamp for stamp in told["timer"] if stamp not in ends]
    assert min(later - earlier for earlier, later in pairwise(others)) >= 10**8


def test_timesteps_of_the_timer_begin_by_the_clock() -> None:
    moves = record("schedule=timer").leader_moved
    starts = [16.0, 32.0, 48.0, 64.0, 68.0, 72.0]
    for move, start in zip(moves, starts, strict=True):
        assert start < move.stamp_ns / 1e9 < start + 2.0


def test_delayed_places_lag_by_a_step_per_robot() -> None:
    found = analysed("schedule=timer", "spacing=delayed", "leader.timesteps=8")
    for follower in found.followers:
        assert follower.totals["formation_error_rmse_m"] < 0.015
        assert follower.totals["leader_error_rmse_m"] < 0.02
        assert 0.03 < follower.totals["lag_m"] < 0.06
    tracks = record("schedule=timer", "spacing=delayed", "leader.timesteps=8").tracks
    ends = [tracks[robot].positions_m[-1, 1] for robot in ("leader", "follower_1", "follower_2")]
    assert np.allclose(np.diff(ends), -0.05, atol=0.02)


def test_steps_aside_are_not_taken_for_turns_where_nobody_checks_headings() -> None:
    """In this run follower 2 turned away by 9 degrees until timestep 11, and by 24 until timestep 16."""
    found = analysed(
        *("schedule=timer", "spacing=delayed", "leader.path=slalom", "leader.path_parameters=[step_m=0.03, period=20]"),
        *("world.surface_parameters=[size_m=6.0, curvature_per_m=0.02]", "start_x_m=1.4", "start_y_m=1.5"),
        *("leader.timesteps=11", "seed=6"),
    )
    assert found.outcome == "done"
    headings = [timestep.heading_error_rad or np.nan for timestep in found.followers[1].timesteps]
    assert len(headings) == 11
    assert np.all(np.abs(headings) < np.radians(4.0))


@pytest.mark.parametrize("settings", [("schedule=turns",), ("schedule=timer", "spacing=delayed")])
def test_a_formation_closes_up_while_its_leader_stands(settings: tuple[str, ...]) -> None:
    """Steps of no length are timesteps like others; who lags behind arrives meanwhile."""
    stop = ("leader.path=stop", "leader.path_parameters=[before=4, standing=4]", "leader.timesteps=8")
    found = record(*settings, *stop)
    assert [move.motion.x_m > 0.03 for move in found.leader_moved] == [True] * 4 + [False] * 4
    assert [len(follower.displacements) for follower in found.followers] == [8, 8]
    ends = [found.tracks[robot].positions_m[-1, 1] for robot in ("leader", "follower_1", "follower_2")]
    assert np.allclose(ends, ends[0], atol=0.02)


@pytest.mark.parametrize(
    "settings",
    [
        ("schedule=together", "blackouts=[[2, 4]]", "leader.path=slalom", "leader.path_parameters=[step_m=0.03]"),
        ("schedule=together", "fine_tuner.look.frames=5"),
        ("schedule=timer", "leader.period_s=2.0"),
    ],
)
def test_ticks_and_frames_may_be_early_late_or_few(settings: tuple[str, ...]) -> None:
    found = analysed("followers=1", *settings)
    assert found.followers[0].totals["timesteps_finished"] == 6


def test_who_waits_for_its_neighbours_step_is_behind_meanwhile() -> None:
    turns, timer = (analysed(f"schedule={name}").followers[0].totals for name in ("turns", "timer"))
    assert turns["formation_error_moving_max_m"] > 0.045
    assert timer["formation_error_moving_max_m"] < turns["formation_error_moving_max_m"]
    assert turns["gap_min_m"] > 0.03
    assert turns["touches"] == timer["touches"] == 0


def test_a_blind_follower_of_delayed_places_drives_on() -> None:
    found = analysed(
        "schedule=timer", "spacing=delayed", "blackouts=[[5, 2]]", "followers=1", "leader.timesteps=10"
    ).followers[0]
    assert found.totals["formation_error_max_m"] < 0.03


def test_moves_of_the_first_alignment_are_not_of_the_first_timestep() -> None:
    """In a wave the leader drives its first step while the second follower still aligns."""
    found = record("schedule=wave", "fine_tuner.precise.placed_m=0", "leader.timesteps=3")
    for follower in found.followers:
        moves = moves_of_timestep(found, follower, 1)
        total = Motion()
        for index in moves:
            total = total.then(follower.moved[index].motion)
        assert np.hypot(total.x_m, total.y_m) == pytest.approx(0.05, abs=0.02)


def test_rigid_places_have_no_lag() -> None:
    assert analysed("schedule=together").followers[0].totals["lag_m"] == 0.0


def test_the_same_seed_gives_the_same_run() -> None:
    again = run_in_memory(scenario("schedule=together"))
    assert again.followers == record("schedule=together").followers


def test_a_third_robots_marker_is_hidden() -> None:
    """Three followers on gentle ground: without boards behind the markers the third searches for its neighbour."""
    found = analysed("followers=3", "schedule=together", "leader.timesteps=10")
    assert scenario("followers=3").world.marker.backdrop_m == 0.16
    assert scenario("followers=1").world.marker.backdrop_m == 0.0
    assert scenario("followers=3", "world.marker.backdrop_m=0").world.marker.backdrop_m == 0.0
    assert all(not follower.totals["losses"] for follower in found.followers)
    assert max(follower.totals["formation_error_rmse_m"] for follower in found.followers) < 0.02


def test_followers_of_a_chain_that_correct_in_turn_keep_narrower_tolerances() -> None:
    """A follower's step aside looks like a turn to the one behind it."""

    def tolerances_m(*settings: str) -> tuple[float, float]:
        precise = scenario(*settings).fine_tuner.precise
        return precise.u_tolerance_m, precise.v_tolerance_m

    alone = tolerances_m("followers=1")
    for schedule in ("turns", "wave"):
        found = tolerances_m("followers=2", f"schedule={schedule}")
        assert all(one < other for one, other in zip(found, alone, strict=True))
        assert tolerances_m("followers=1", f"schedule={schedule}") == alone
    for schedule in ("together", "timer"):  # a correction there moves everybody behind it once more, or there is none
        assert tolerances_m("followers=2", f"schedule={schedule}") == alone
    own = tolerances_m("followers=2", "fine_tuner.precise.u_tolerance_m=0.02")
    assert own == (0.02, tolerances_m("followers=2")[1])


def test_edges_before_a_light_board_are_known() -> None:
    """Without that a follower of a chain stands 6 mm too near."""

    def bottom_px(*settings: str) -> float:
        return scenario(*settings).fine_tuner.precise.edges.target_bottom_px

    alone = bottom_px("followers=1")
    assert bottom_px("followers=2") < alone - 0.5
    assert bottom_px("followers=2", "schedule=timer", "spacing=delayed") == alone  # a dark board
    assert bottom_px("followers=2", "world.marker.backdrop_m=0") == alone
    assert bottom_px("followers=2", "marker=tags") == bottom_px("followers=1", "marker=tags") == 0.0
    assert bottom_px("followers=2", "fine_tuner.precise.edges.target_bottom_px=-1") == -1.0
    late = analysed("followers=2").followers[0].timesteps[3:]
    off_u_m = [t.error_uv_m[0] for t in late if t.error_uv_m is not None]
    assert len(off_u_m) == 3
    assert abs(float(np.mean(off_u_m))) < 0.004


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["spacing=delayed"], "needs a schedule in which robots move at the same time"),
        (["schedule=fast"], "'schedule' can't be 'fast'; there are: "),
        (["fine_tuner.schedule=wave"], "set 'schedule' of the scenario instead"),
        (["leader.schedule=wave"], "set 'schedule' of the scenario instead"),
        (["world.period_s=1.0"], "set 'leader.period_s' instead"),
    ],
)
def test_what_does_not_fit_is_refused(settings: list[str], message: str) -> None:
    with pytest.raises(FormationError, match=message):
        scenario(*settings)


def test_a_chain_stands_on_the_plate() -> None:
    override(load_track("one"), ["followers=2"]).check()
    with pytest.raises(FormationError, match=r"follower_3 would stand with a part of its body beyond the plate.*1\.85"):
        override(load_track("one"), ["followers=3"]).check()


@pytest.mark.parametrize(("name", "followers"), [("line_of_five", 5), ("line_of_ten", 10)])
def test_lines_fit_their_plates(name: str, followers: int) -> None:
    found = load(presets()[name])
    found.check()
    assert found.setup.followers == followers


def test_time_stands_still_for_late_robots_too_when_the_leader_ends_the_run_by_the_clock() -> None:
    """Over the graph the world would go on with their moves, for as long as the leader's node takes to end."""
    late = ["leader.step_m=0.2", "leader.period_s=2.0", "leader.timesteps=3", "drive.wheel_speed_rad_s=1.5"]
    run = InProcessRun(override(load_track("two"), ["schedule=timer", "world.camera.mode=on_demand", *late]))
    assert run.run() == (0, "")
    assert run._world._world.owes
    assert not run._world.busy
