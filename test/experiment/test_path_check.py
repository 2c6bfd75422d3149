"""What follows from the leader's path beforehand, and what is refused before anything moves."""

import math
from pathlib import Path

import numpy as np
import pytest

from robot_formation.errors import FormationError
from robot_formation.experiment.path_plan import formation
from robot_formation.experiment.scenario import Scenario, load, load_track, override, with_option
from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths import PATHS
from robot_formation.leader.rigid_formation import track_of

TRACK = load_track("two")
MADE = [name for name in PATHS if name not in ("straight", "waypoints", "teleop")]


def scenario(path: str, *settings: str, parameters: str = "") -> Scenario:
    return override(
        TRACK, ["heading_deg=90", f"leader.path={path}", f"leader.path_parameters=[{parameters}]", *settings]
    )


def boxes(made: Scenario) -> np.ndarray:
    """The bodies' boxes over a run, as the paths' plan has them."""
    start = Motion(made.setup.start_x_m, made.setup.start_y_m, math.radians(made.setup.heading_deg))
    whole = formation(made.world, made.slots)
    return whole.boxes(track_of(made.leader.make_path(), made.leader.timesteps, start))


def refused(made: Scenario) -> str:
    with pytest.raises(FormationError) as error:
        made.check()
    assert "\n" not in str(error.value)
    return str(error.value)


# --- the start --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("seed", [0, 1, 7])
def test_every_path_has_a_start_from_which_it_fits_whatever_its_phase(name: str, seed: int) -> None:
    made = scenario(name, f"seed={seed}")
    made.check()
    assert boxes(made).min() >= 0.0
    assert boxes(made).max() <= 1.78


def test_a_start_that_is_given_is_kept_and_a_presets_is_that_of_its_straight_path() -> None:
    assert (TRACK.setup.start_x_m, TRACK.setup.start_y_m) == (1.412, 0.111)
    given = scenario("circle", "start_x_m=0.8", "start_y_m=0.9")
    assert (given.setup.start_x_m, given.setup.start_y_m) == (0.8, 0.9)
    assert override(given, ["seed=9"]).setup.start_x_m == 0.8
    assert override(scenario("straight"), ["seed=9"]).setup.start_x_m == 1.412
    chosen = scenario("circle")
    assert chosen.setup.start_x_m != 1.412
    assert override(chosen, ["seed=9"]).setup.start_x_m != chosen.setup.start_x_m


def test_a_files_start_belongs_to_its_path(tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    file.write_text("start_x_m: 0.8\nstart_y_m: 0.9\nleader:\n  path: circle\n")
    assert load(file).setup.start_x_m == 0.8
    assert with_option(load(file), "leader.path", "slalom", "--path").setup.start_x_m != 0.8


def test_a_random_walk_is_given_the_room_that_its_formation_has() -> None:
    room = scenario("random_walk").leader.room_m
    # Ahead and back half a plate less half a body and the margin; sideways less the follower too.
    assert room == pytest.approx([0.5 * (1.78 - 0.365) - 0.05] * 2 + [0.5 * (1.78 - 0.238 - 0.32) - 0.05] * 2)


# --- the first step ---------------------------------------------------------------------------------------------------


def test_the_followers_first_step_is_known_from_the_path() -> None:
    made = scenario("slalom", parameters="phase=0, step_m=0.04, amplitude_m=0.03")
    tuner, closing = made.fine_tuner, made.predictor.closing
    assert (tuner.first_step_m, tuner.first_step_u_m, tuner.first_turn_rad) == (0.04, -0.03, 0.0)
    assert (closing.step_v_m, closing.step_u_m) == (0.04, -0.03)
    assert override(made, ["fine_tuner.first_step_m=0.01"]).fine_tuner.first_step_m == 0.01


def test_each_follower_has_the_first_step_of_its_own_lever_arm() -> None:
    from robot_formation.components.catalogue import KINDS

    made = scenario("circle", "followers=2", parameters="heading=along, radius_m=0.6")
    firsts = [made.of_robot(KINDS["fine_tuner"], robot) for robot in ("follower_1", "follower_2")]
    turn = firsts[0].first_turn_rad
    assert turn == pytest.approx(2.0 * math.asin(0.025 / 0.6))
    for number, first in enumerate(firsts, start=1):
        assert first.first_turn_rad == turn
        assert first.first_step_m == pytest.approx(0.05 * math.cos(turn / 2) + 0.32 * number * math.sin(turn))
    assert made.of_robot(KINDS["predictor"], "follower_2").closing.step_v_m == firsts[1].first_step_m


def test_a_straight_leaders_followers_know_its_step_as_ever() -> None:
    tuner = TRACK.fine_tuner
    assert (tuner.first_step_m, tuner.first_step_u_m, tuner.first_turn_rad) == (0.05, 0.0, 0.0)
    assert override(TRACK, ["leader.step_m=0.03"]).fine_tuner.first_step_m == 0.03


def test_prediction_moves_may_be_longer_where_the_path_is_not_straight() -> None:
    assert (TRACK.fine_tuner.max_v_m, TRACK.fine_tuner.max_u_m) == (0.1, 0.05)
    tuner = scenario("circle").fine_tuner
    assert (tuner.max_v_m, tuner.max_u_m) == pytest.approx((0.15, 0.32 - 0.238 - 0.007))
    assert scenario("circle", "fine_tuner.max_u_m=0.03").fine_tuner.max_u_m == 0.03


# --- refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "parameters", "settings", "said"),
    [
        ("nosuch", "", [], ["no path 'nosuch'"]),
        ("circle", "perid=3", [], ["no parameter 'perid'; did you mean 'period'?"]),
        ("waypoints", "", [], ["name its CSV file"]),
        (
            "slalom", "", ["leader.timesteps=60"],
            ["leader would leave the plate of 1.78 x 1.78 m in timestep 2", "step_m=0.02", "size_m=", "timesteps=2"],
        ),
        ("lemniscate", "amplitude_m=0.9, period=130", ["leader.timesteps=130"], ["leave the plate", "amplitude_m="]),
        ("circle", "", ["start_x_m=0.1", "start_y_m=0.9"], ["leader would leave the plate", "at the start"]),
        (
            "circle", "heading=along, radius_m=0.1", [],
            ["follower_1 would move 0.203 m along v, beyond the drive's range of 0.2 m, in timestep 1", "step_m=0.048"],
        ),
        ("lemniscate", "amplitude_m=1", [], ["leader would move", "m along u, beyond", "period=", "would fit"]),
        ("slalom", "amplitude_m=0.09", [], ["come within a centimetre", "amplitude_m=0.072 would fit"]),
        ("pulse", "amplitude_m=0.15", [], ["marker in its camera's view", "amplitude_m=0.11"]),
        ("random_walk", "", ["followers=9"], ["which is too small for steps of 0.05 m"]),
        ("straight", "", ["leader.timesteps=100"], ["leader would leave the plate", "in timestep 34", "timesteps=33"]),
    ],
)  # fmt: skip
def test_a_path_that_cannot_be_followed_is_refused(
    path: str, parameters: str, settings: list[str], said: list[str]
) -> None:
    text = refused(scenario(path, *settings, parameters=parameters))
    assert [part for part in said if part not in text] == []


@pytest.mark.parametrize(
    ("path", "parameters", "settings", "remedy"),
    [
        ("slalom", "", ["leader.timesteps=60"], "step_m"),
        ("slalom", "", ["leader.timesteps=60"], "leader.timesteps"),
        ("slalom", "", ["leader.timesteps=60"], "size_m"),
        ("lemniscate", "amplitude_m=0.9, period=130", ["leader.timesteps=130"], "amplitude_m"),
        ("lemniscate", "amplitude_m=1", [], "period"),
    ],
)
def test_what_is_said_to_fit_does(path: str, parameters: str, settings: list[str], remedy: str) -> None:
    text = refused(scenario(path, *settings, parameters=parameters))
    value = text.split(f"{remedy}=")[1].split("]")[0].split()[0].rstrip(")")
    if remedy == "size_m":
        settings = [*settings, f"world.surface_parameters=[size_m={value}]"]
    elif "." in remedy:
        settings = [*settings, f"{remedy}={value}"]
    else:
        kept = [part for part in parameters.split(", ") if part and not part.startswith(remedy)]
        parameters = ", ".join([*kept, f"{remedy}={value}"])
    scenario(path, *settings, parameters=parameters).check()


def test_a_step_of_a_file_beyond_the_range_is_refused_with_its_timestep(tmp_path: Path) -> None:
    file = tmp_path / "way.csv"
    file.write_text("x_m,y_m\n0,0\n0.05,0\n0.3,0\n")
    text = refused(scenario("waypoints", "leader.timesteps=2", parameters=f"file={file}"))
    assert "leader would move 0.250 m along v, beyond the drive's range of 0.2 m, in timestep 2" in text


def test_where_leaving_the_plate_ends_no_run_a_straight_path_may_leave_it() -> None:
    scenario("straight", "leader.timesteps=100", "world.leaving_ends_run=false").check()
