"""Slots: what a scenario may say of its followers' places, what it refuses, and runs that keep them."""

import json
import math
from pathlib import Path

import pytest

from robot_formation.analysis.conditions import conditions_text, run_facts
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.run_record import RunRecord
from robot_formation.bag.run_details import said_slots
from robot_formation.components.catalogue import KINDS
from robot_formation.errors import FormationError
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.scenario import Scenario, load, load_track, override, presets
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import slot
from robot_formation.launching.processes import progress, run_metadata

GROUND = (
    "world.surface_parameters=[size_m=2.6, curvature_per_m=0.06]",
    "start_x_m=0.82",
    "start_y_m=0.9",
    "world.camera.mode=on_demand",
    "world.overhead.enabled=false",
    "followers=2",
    "leader.timesteps=8",
    "seed=5",
)


def scenario(*settings: str) -> Scenario:
    return override(load_track("one"), [*GROUND, *settings])


def places_of_nodes(made: Scenario) -> list[Motion]:
    return [made.of_robot(KINDS["fine_tuner"], robot).place for robot in made.robots[1:]]


def test_abreast_is_what_it_was() -> None:
    assert scenario().slots == (slot(0.32), slot(0.32))
    assert scenario("fine_tuner.formation_distance_m=0.35").slots == (slot(0.35), slot(0.35))
    assert scenario().world.start_x_m == (0.82, 0.82 + 0.32, 0.82 + 0.64)


@pytest.mark.parametrize(
    ("settings", "slots"),
    [
        (["formation=echelon"], [slot(0.32, -0.05), slot(0.32, -0.05)]),
        (["formation=echelon", "fine_tuner.formation_distance_m=0.35"], [slot(0.35, -0.05), slot(0.35, -0.05)]),
        (["slots=[[0.3, 0.08]]"], [slot(0.3, 0.08), slot(0.3, 0.08)]),
        (["slots=[[0.3, 0.05], [0.4, -0.02]]"], [slot(0.3, 0.05), slot(0.4, -0.02)]),
    ],
)
def test_slots_reach_nodes_starts_and_what_a_run_says(settings: list[str], slots: list[Motion]) -> None:
    made = scenario(*settings)
    made.check()
    assert places_of_nodes(made) == list(made.slots) == slots
    starts = [Motion(start.x_m, start.y_m, start.heading_rad) for start in made.world.starts()]
    for place, robot, neighbour in zip(slots, starts[1:], starts, strict=False):
        found = robot.relative_to(neighbour)
        assert (found.x_m, found.y_m) == pytest.approx((place.x_m, place.y_m))
    record = RunRecord((), (), details=run_metadata(made))
    assert [record.place(robot) for robot in made.robots[1:]] == slots
    assert record.leader_place("follower_2").v_m == pytest.approx(sum(place.v_m for place in slots))
    assert progress(made, "").parameters["slots"] == [length for place in slots for length in place.uv_m]


def test_a_turning_leaders_followers_begin_with_the_steps_of_their_own_places() -> None:
    made = scenario("formation=echelon", "leader.path=circle", "leader.path_parameters=[heading=along, radius_m=0.9]")
    turn = 0.05 / 0.9
    for number, robot in enumerate(made.robots[1:], 1):
        ahead_m, right_m = -0.05 * number, 0.32 * number
        tuner = made.of_robot(KINDS["fine_tuner"], robot)
        # By the chord of the leader's step, 5 cm of arc, and by the lever arm of the place.
        chord = Motion(0.9 * math.sin(turn), 0.9 * (1.0 - math.cos(turn)))
        sideways = chord.y_m + ahead_m * math.sin(turn) - right_m * (math.cos(turn) - 1.0) * -1.0
        assert tuner.first_turn_rad == pytest.approx(turn, rel=0.01)
        assert tuner.first_step_m == pytest.approx(0.05 + right_m * math.sin(turn), abs=0.004)
        assert -tuner.first_step_u_m == pytest.approx(sideways, abs=0.004)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["formation=vee"], "can't see its Target face"),
        (["formation=echelo"], "no formation 'echelo'; did you mean 'echelon'"),
        (["slots=[[0.32, 0.0]]", "formation=echelon"], "keep one of them"),
        (["slots=[[0.32, 0.0]]", "fine_tuner.formation_distance_m=0.3"], "keep one"),
        (
            ["slots=[[0.32, 0.0], [0.32, 0.0], [0.32, 0.0]]"],
            "a pair for each follower, 2 in all, .*, not 3",
        ),
        (["slots=[[-0.32, 0.0]]"], "would not be on its neighbour's right"),
        (["slots=[0.32, 0.0]"], r"a list of pairs like \[\[0.32, -0.05\]\]"),
        (["slots=[[0.32, behind]]"], "must be of type float, not 'behind'"),
        (["slots=[[0.24, -0.05]]"], "leaves less than"),
        (["slots=[[0.32, 0.0], [0.25, 0.0]]"], "leaves less than"),
        (["slots=[[0.32, 0.0], [0.32, 0.05]]", "fine_tuner.mode=paper"], "it needs to see the Target face alone"),
        (["slots=[[0.32, 0.0], [0.32, 0.6]]"], "outside -0.5 to 0.5 m"),
        (["slots=[[0.245, 0.0]]", "fine_tuner.mode=paper"], "within a centimetre of each other"),
        (["slots=[[0.32, -0.12]]"], r"whole Target face in view; from 0.105 m behind to 0.155 m ahead it would"),
        (["slots=[[0.32, 0.17]]"], r"whole Target face in view; from 0.105 m behind to 0.155 m ahead it would"),
        (["slots=[[0.32, 0.1], [0.32, -0.1]]"], "follower_2's place.* past the neighbour's board"),
        (["formation=echelon", "fine_tuner.mode=paper"], "it needs to see the Target face alone"),
        (["formation=echelon", "start_y_m=0.2"], r"beyond the plate .* another start \(start_y_m=0.21 would do\)"),
        (["fine_tuner.formation_ahead_m=0.05"], "set 'formation' or 'slots' of the scenario instead"),
    ],
)
def test_what_no_follower_can_keep_is_refused_in_a_line(settings: list[str], message: str) -> None:
    with pytest.raises(FormationError, match=message) as refused:
        scenario(*settings).check()
    assert "\n" not in str(refused.value)


def test_one_follower_may_stand_where_two_would_show_two_markers() -> None:
    scenario("followers=1", "slots=[[0.32, 0.1]]").check()
    scenario("slots=[[0.32, 0.1], [0.32, 0.05]]").check()


@pytest.mark.parametrize("text", ["", "[", "[1, 2]", "[[1]]", '[["a", 2]]', "[[1e300, 0]]", "[[true, 0]]", "{}"])
def test_a_bag_that_says_no_places_has_those_abreast(text: str) -> None:
    details = {"slots": text, "parameters": json.dumps({"fine_tuner": {"formation_distance_m": 0.35}})}
    assert said_slots(details) == []
    record = RunRecord((), (), details=details)
    assert record.place("follower_3") == slot(0.35)
    assert record.leader_place("follower_3") == slot(0.35 * 3)


def test_slots_are_conditions_of_a_run_unless_abreast() -> None:
    echelon = run_facts(run_metadata(scenario("formation=echelon")))["conditions"]
    assert echelon["slots"] == [[0.32, -0.05], [0.32, -0.05]]
    assert "slots [[0.32, -0.05], [0.32, -0.05]] m" in conditions_text(echelon)
    assert run_facts(run_metadata(scenario("slots=[[0.3, 0.0], [0.35, 0.0]]")))["conditions"]["slots"][1] == [0.35, 0.0]
    assert "slots" not in run_facts(run_metadata(scenario()))["conditions"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [
        [],
        ["leader.path=circle", "leader.path_parameters=[radius_m=0.8, heading=along, direction=left]"],
    ],
    ids=["straight", "turning"],
)
def test_an_echelon_keeps_its_places(path: list[str]) -> None:
    found = analyse(run_in_memory(scenario("formation=echelon", *path)))
    assert found.outcome == "done"
    for number, follower in enumerate(found.followers, 1):
        assert follower.totals["formation_error_rmse_m"] < 0.015
        assert follower.totals["leader_error_rmse_m"] < 0.015 * number + 0.01
        assert not follower.totals["losses"]


def test_the_preset_of_an_echelon_fits_its_plate(tmp_path: Path) -> None:
    made = load(presets()["echelon_of_three"])
    made.check()
    assert len(made.slots) == 3
    assert all(place.v_m < 0.0 for place in made.slots)
