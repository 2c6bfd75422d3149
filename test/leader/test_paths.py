"""The leader's paths against what geometry says of them."""

import math
from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths import PATHS, Given, LeaderPath, Room, make_path, poses
from robot_formation.parameters import ParameterError

SEED = Given(seed=5)
OWN = [name for name in PATHS if name != "waypoints"]
phases = st.floats(0.0, 0.99)
periods = st.integers(3, 60)


def path(name: str, *texts: str, given: Given = SEED) -> LeaderPath:
    return make_path(name, texts, given)


def ends(made: LeaderPath, timesteps: int) -> Motion:
    return poses(made, timesteps)[-1]


def lengths(made: LeaderPath, timesteps: int) -> list[float]:
    steps = [made.motion(timestep) for timestep in range(1, timesteps + 1)]
    return [math.hypot(step.x_m, step.y_m) for step in steps]


def close_to(pose: Motion, *expected: float) -> bool:
    found = (pose.x_m, pose.y_m, math.remainder(pose.yaw_rad, 2.0 * math.pi))
    return all(abs(a - b) < 1e-9 for a, b in zip(found, expected, strict=True))


# --- all of them ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OWN)
def test_a_path_is_a_pure_function_of_timestep_and_seed(name: str) -> None:
    forward = [path(name).motion(timestep) for timestep in range(1, 31)]
    made = path(name)
    assert [made.motion(timestep) for timestep in range(30, 0, -1)][::-1] == forward
    assert all(step.finite for step in forward)


@pytest.mark.parametrize(
    "name", ["circle", "slalom", "pulse", "chirp", "lemniscate", "lissajous", "stadium", "random_walk"]
)
def test_another_seed_gives_another_phase_and_a_given_phase_stays(name: str) -> None:
    assert path(name, given=Given(seed=1)).motion(1) != path(name, given=Given(seed=2)).motion(1)
    if name != "random_walk":
        first = path(name, "phase=0.3", given=Given(seed=1))
        assert first.motion(1) == path(name, "phase=0.3", given=Given(seed=2)).motion(1)


@pytest.mark.parametrize(
    "name",
    [
        *("straight", "circle", "arc", "slalom", "pulse", "speed_step", "stop", "chirp"),
        *("stadium", "clothoid", "random_walk"),
    ],
)
def test_the_leaders_step_is_the_default_of_a_paths_own(name: str) -> None:
    made = path(name, given=Given(step_m=0.03, seed=5))
    assert [made.motion(t) for t in (1, 2)] == [path(name, "step_m=0.03").motion(t) for t in (1, 2)]


@pytest.mark.parametrize(
    ("name", "texts", "said"),
    [
        ("circel", [], "no path 'circel'; did you mean 'circle'?"),
        ("circle", ["perid=3"], "no parameter 'perid'; did you mean 'period'?"),
        ("circle", ["period"], "are texts like 'period=12', not 'period'"),
        ("circle", ["period=many"], "'period' needs a number, not 'many'"),
        ("circle", ["period=nan"], "'period' must be finite"),
        ("circle", ["period=12", "period=13"], "'period' is given twice"),
        ("circle", ["heading=sideways"], "'heading' can't be 'sideways'"),
        ("circle", ["period=12", "radius_m=1"], "give 'period' or 'radius_m', not both"),
        ("circle", ["period=1.5"], "'period' must be 2 or more"),
        ("circle", ["radius_m=0.01"], "the radius must be at least 0.025 m"),
        ("lissajous", ["cycles=1.5"], "'cycles' needs a whole number, not '1.5'"),
        ("lissajous", ["heading=along", "cycles=3", "sideways_cycles=1"], "goes back on itself"),
        ("switch", ["parts=straight circle"], "only the last may be without its timesteps"),
        ("switch", ["parts=straight:0"], "'straight:0' is no part"),
        ("switch", ["parts=strait:3"], "no path 'strait'; did you mean 'straight'?"),
        ("switch", ["parts=slalom:3", "slalom.perid=3"], "no parameter 'perid'; did you mean 'period'?"),
        ("switch", ["parts=switch:3"], "'switch' can't be a part"),
        ("circle", ["cirle.period=12"], "no path 'cirle'"),
        ("waypoints", [], "name its CSV file"),
    ],
)
def test_what_cannot_be_made_is_refused_in_one_line(name: str, texts: Sequence[str], said: str) -> None:
    with pytest.raises(ParameterError) as error:
        make_path(name, texts)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_paths_can_share_texts_that_name_their_path() -> None:
    texts = ["circle.period=20", "slalom.period=8", "phase=0"]
    assert make_path("circle", texts).motion(6) == make_path("circle", ["period=20", "phase=0"]).motion(6)
    assert make_path("slalom", texts).motion(6) == make_path("slalom", ["period=8", "phase=0"]).motion(6)


# --- by family --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("slalom.perood=3", "did you mean 'period'"),
        ("slalom.period", "give 'period' once"),
    ],
)
def test_a_wrong_text_for_another_path_is_refused(text: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        path("circle", text)
    with pytest.raises(ParameterError, match="give 'period' once"):
        path("switch", "parts=straight:2 circle", "circle.period=3", "circle.period=30")


def test_a_circle_without_period_and_radius_has_a_period_of_12() -> None:
    assert path("circle", "phase=0") == path("circle", "phase=0", "period=12")


def test_straight_is_the_step_and_nothing_else() -> None:
    assert path("straight").motion(7) == Motion(x_m=0.05)


@given(periods, phases)
def test_a_circle_with_the_heading_kept_turns_each_step_by_a_share_of_a_turn(period: int, phase: float) -> None:
    made = path("circle", f"period={period}", f"phase={phase}")
    steps = [made.motion(timestep) for timestep in range(1, period + 1)]
    angles = [math.atan2(step.y_m, step.x_m) for step in steps]
    turns = [math.remainder(b - a, 2.0 * math.pi) for a, b in pairwise(angles)]
    assert turns == pytest.approx([2.0 * math.pi / period] * (period - 1))
    assert lengths(made, period) == pytest.approx([0.05] * period)
    assert {step.yaw_rad for step in steps} == {0.0}
    assert close_to(ends(made, period), 0.0, 0.0, 0.0)
    assert math.remainder(angles[0] - 2.0 * math.pi * phase, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("direction", "side"), [("left", 1.0), ("right", -1.0)])
def test_a_circle_along_the_path_stays_on_its_radius_and_tangential(direction: str, side: float) -> None:
    made = path("circle", "heading=along", "radius_m=0.6", f"direction={direction}")
    for pose in poses(made, 80):
        assert math.hypot(pose.x_m, pose.y_m - side * 0.6) == pytest.approx(0.6)
        # The heading is normal to the radius.
        outward = (pose.x_m, pose.y_m - side * 0.6)
        assert math.cos(pose.yaw_rad) * outward[0] + math.sin(pose.yaw_rad) * outward[1] == pytest.approx(0.0, abs=1e-9)
    assert lengths(made, 80) == pytest.approx([0.05] * 80)
    assert close_to(ends(path("circle", "heading=along", "period=16"), 16), 0.0, 0.0, 0.0)


def test_an_arc_is_straight_then_round_then_straight() -> None:
    made = path("arc", "before=4", "radius_m=0.5", "angle_deg=90", "step_m=0.05")
    assert close_to(poses(made, 4)[-1], 0.2, 0.0, 0.0)
    assert [made.motion(t).yaw_rad for t in (5, 6)] == pytest.approx([0.1, 0.1])
    assert close_to(ends(made, 30), 0.7, 1.5 - 0.2 - 0.25 * math.pi + 0.5, 0.5 * math.pi)
    assert close_to(ends(path("arc", "angle_deg=360", "radius_m=0.5"), 100), 5.0 - math.pi, 0.0, 0.0)


@given(periods, phases)
def test_a_slalom_steps_forward_and_by_a_cosine_sideways(period: int, phase: float) -> None:
    made = path("slalom", f"period={period}", f"phase={phase}", "amplitude_m=0.02", "step_m=0.03")
    for timestep in range(1, period + 1):
        sideways = 0.02 * math.cos(2.0 * math.pi * ((timestep - 1) / period + phase))
        step = made.motion(timestep)
        assert (step.x_m, step.yaw_rad) == (0.03, 0.0)
        assert step.y_m == pytest.approx(sideways, abs=1e-12)
    assert close_to(ends(made, period), 0.03 * period, 0.0, 0.0)


def test_a_slalom_along_the_path_goes_the_same_way_as_with_the_heading_kept() -> None:
    texts = ("period=14", "phase=0.1")
    kept, along = (poses(path("slalom", *texts, f"heading={heading}"), 30) for heading in ("kept", "along"))
    start_angle = math.atan2(
        0.03 * (math.pi / 14) / math.sin(math.pi / 14) * math.cos(2 * math.pi * (0.1 - 0.5 / 14)), 0.05
    )
    turned = [Motion(yaw_rad=start_angle).then(pose) for pose in along]
    assert [(pose.x_m, pose.y_m) for pose in turned] == [pytest.approx((pose.x_m, pose.y_m)) for pose in kept]


@given(periods, phases)
def test_a_pulse_varies_its_step_by_a_cosine_around_the_mean(period: int, phase: float) -> None:
    made = path("pulse", f"period={period}", f"phase={phase}", "amplitude_m=0.02", "step_m=0.05")
    steps = [made.motion(timestep) for timestep in range(1, period + 1)]
    assert sum(step.x_m for step in steps) == pytest.approx(0.05 * period)
    assert steps[0].x_m == pytest.approx(0.05 + 0.02 * math.cos(2.0 * math.pi * phase))
    assert {(step.y_m, step.yaw_rad) for step in steps} == {(0.0, 0.0)}


def test_a_speed_step_changes_the_steps_once() -> None:
    made = path("speed_step", "before=3", "amplitude_m=0.02", "step_m=0.04")
    assert lengths(made, 6) == pytest.approx([0.04] * 3 + [0.06] * 3)
    assert close_to(ends(made, 6), 0.3, 0.0, 0.0)


def test_a_stop_is_a_stand_between_equal_steps() -> None:
    made = path("stop", "before=2", "standing=3")
    assert [made.motion(timestep) for timestep in range(1, 8)] == [Motion(0.05)] * 2 + [Motion()] * 3 + [
        Motion(0.05)
    ] * 2


@given(periods, periods, st.integers(1, 60), phases)
def test_a_chirps_frequency_changes_evenly_and_then_stays(first: int, last: int, sweep: int, phase: float) -> None:
    texts = (f"period={first}", f"last_period={last}", f"sweep={sweep}", f"phase={phase}")
    made = path("chirp", *texts, "step_m=0.05", "amplitude_m=0.02")
    turns, frequency = phase, 1.0 / first
    for timestep in range(1, sweep + 20):
        assert made.motion(timestep).x_m == pytest.approx(0.05 + 0.02 * math.cos(2.0 * math.pi * turns), abs=1e-9)
        # The mean frequency of a timestep is that of its middle.
        slope = (1.0 / last - 1.0 / first) / sweep if timestep <= sweep else 0.0
        turns += frequency + 0.5 * slope
        frequency += slope


def test_a_chirp_of_one_period_is_a_pulse() -> None:
    chirp, pulse = path("chirp", "period=9", "last_period=9", "phase=0.2"), path("pulse", "period=9", "phase=0.2")
    assert lengths(chirp, 50) == pytest.approx(lengths(pulse, 50))


@given(st.integers(8, 80), phases, st.sampled_from(["kept", "along"]))
@settings(max_examples=40)
def test_a_lemniscate_is_geronos_and_closes(period: int, phase: float, heading: str) -> None:
    made = path("lemniscate", f"period={period}", f"phase={phase}", "amplitude_m=0.3", f"heading={heading}")
    assert close_to(ends(made, period), 0.0, 0.0, 0.0)
    if heading == "kept":
        angles = [2.0 * math.pi * (time / period + phase) for time in range(period + 1)]
        points = [(0.3 * math.sin(a), 0.3 * math.sin(a) * math.cos(a)) for a in angles]
        for timestep, (before, after) in enumerate(pairwise(points), start=1):
            step = made.motion(timestep)
            assert (step.x_m, step.y_m) == pytest.approx((after[0] - before[0], after[1] - before[1]), abs=1e-12)


@pytest.mark.parametrize("heading", ["kept", "along"])
def test_a_lissajous_figure_fills_its_box_and_closes(heading: str) -> None:
    made = path("lissajous", "period=60", "amplitude_m=0.3", "sideways_m=0.2", f"heading={heading}", "phase=0")
    assert close_to(ends(made, 60), 0.0, 0.0, 0.0)
    if heading == "kept":
        track = poses(made, 60)
        assert max(pose.x_m for pose in track) == pytest.approx(0.3)
        assert min(pose.x_m for pose in track) == pytest.approx(-0.3)
        assert max(abs(pose.y_m) for pose in track) == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize(("direction", "side"), [("left", 1.0), ("right", -1.0)])
def test_a_stadium_closes_after_a_lap_of_straights_and_half_circles(direction: str, side: float) -> None:
    lap = 2.0 * (0.4 + 0.3 * math.pi)
    made = path("stadium", f"step_m={lap / 50}", "length_m=0.4", "radius_m=0.3", f"direction={direction}", "phase=0")
    assert close_to(ends(made, 50), 0.0, 0.0, 0.0)
    assert close_to(ends(made, 25), 0.4, side * 0.6, math.pi) or close_to(ends(made, 25), 0.4, side * 0.6, -math.pi)
    turns = sum(made.motion(timestep).yaw_rad for timestep in range(1, 51))
    assert turns == pytest.approx(side * 2.0 * math.pi)


def test_the_curvature_of_a_clothoid_rises_and_falls_evenly() -> None:
    made = path("clothoid", "radius_m=0.5", "period=20", "direction=left", "phase=0", "step_m=0.05")
    turns = [made.motion(timestep).yaw_rad for timestep in range(1, 21)]
    rises = [b - a for a, b in pairwise(turns)]
    assert rises[:9] == pytest.approx([0.01] * 9)
    assert rises[10:] == pytest.approx([-0.01] * 9)
    assert sum(turns) == pytest.approx(0.5 * 0.05 * 20 / 0.5)  # half of what the least radius would turn
    both = path("clothoid", "radius_m=0.5", "period=20", "phase=0.2")
    assert ends(both, 40).yaw_rad == pytest.approx(0.0, abs=1e-12)


def test_a_clothoid_is_integrated_to_rounding() -> None:
    made = path("clothoid", "radius_m=0.2", "period=7.3", "phase=0.37", "direction=left")
    fine = path("clothoid", "radius_m=0.2", f"period={7.3 * 50}", "phase=0.37", "direction=left", "step_m=0.001")
    first, second = ends(made, 12), ends(fine, 600)
    assert (first.x_m, first.y_m, first.yaw_rad) == pytest.approx((second.x_m, second.y_m, second.yaw_rad), abs=1e-9)


def test_switch_drives_its_parts_one_after_another_and_begins_again() -> None:
    texts = ["parts=straight:3 circle:4 straight:1", "circle.period=8", "circle.phase=0"]
    made = make_path("switch", texts)
    circle = make_path("circle", ["period=8", "phase=0"])
    expected = [Motion(0.05)] * 3 + [circle.motion(t) for t in range(1, 5)] + [Motion(0.05)]
    assert [made.motion(timestep) for timestep in range(1, 17)] == expected * 2
    assert made.timesteps is None


def test_the_last_part_without_a_number_goes_on() -> None:
    made = make_path("switch", ["parts=straight:2 circle", "circle.phase=0"])
    assert made.motion(100) == make_path("circle", ["phase=0"]).motion(98)


@given(st.integers(0, 1000))
@settings(max_examples=25)
def test_a_random_walk_stays_in_its_room_with_steps_of_one_length(seed: int) -> None:
    room = Room(0.3, 0.1, 0.05, 0.25)
    made = path("random_walk", given=Given(seed=seed, room=room))
    for pose in poses(made, 200):
        assert -0.1 - 1e-9 <= pose.x_m <= 0.3 + 1e-9
        assert -0.25 - 1e-9 <= pose.y_m <= 0.05 + 1e-9
    assert lengths(made, 200) == pytest.approx([0.05] * 200)


def test_a_random_walk_without_room_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"a room of 0\.06 x 0\.40 m"):
        path("random_walk", given=Given(room=Room(0.03, 0.03, 0.2, 0.2)))
