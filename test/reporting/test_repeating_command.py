"""The command that repeats a run gives the run's scenario again."""

import json
import shlex

import pytest

from robot_formation.cli.main import make_parser
from robot_formation.cli.run import build_scenario
from robot_formation.experiment.scenario import Scenario, load, load_track, override, presets
from robot_formation.launching.processes import run_metadata
from robot_formation.reporting.changed_parameters import ChangedParameter, changed_parameters
from robot_formation.reporting.repetition import repetition


def repeated(command: str) -> Scenario:
    program, *words = shlex.split(command)
    assert program == "formation"
    return build_scenario(make_parser().parse_args(words))


@pytest.mark.parametrize(
    ("track", "settings"),
    [
        ("two", []),
        ("one", ["seed=7", "predictor.name=measured", "fine_tuner.mode=paper", "world.camera.mode=on_demand"]),
        ("one", ["name=it's one", "followers=2", "schedule=wave", "heading_deg=90.3", "blackouts=[[5, 3]]"]),
        ("two", ["world.surface=ripple", "world.surface_parameters=[middle_m=0.1]", "start_x_m=1.3"]),
        ("two", ["leader.path=lemniscate", "seed=3", "leader.timesteps=12"]),
        ("two", ["leader.path=slalom", "leader.path_parameters=[period=7]", "predictor.forgetting=0.9"]),
        ("two", ["schedule=together", "spacing=delayed", "marker=tags", "predictor.forgetting=5e-2"]),
    ],
)
def test_the_command_makes_the_same_scenario(track: str, settings: list[str]) -> None:
    run = override(load_track(track), settings)
    found = repetition(run_metadata(run))
    assert found is not None
    assert found.missed == ()
    assert repeated(found.command).by_node() == run.by_node()
    assert repeated(found.command).setup == run.setup


def test_the_command_leaves_the_same_nodes_to_others() -> None:
    left_out = ["follower_1/block_detector", "leader/leader"]
    found = repetition(run_metadata(load_track("one"), left_out))
    assert found is not None
    assert make_parser().parse_args(shlex.split(found.command)[1:]).without == left_out


@pytest.mark.parametrize("preset", list(presets()))
def test_the_command_makes_each_preset_again_with_blackouts_and_pushes(preset: str) -> None:
    run = load(presets()[preset])
    last = run.robots[-1]
    blackouts = f"blackouts=[[5, 2], [follower_1, 9, 1], [{last}, 11, 2]]"
    assert_repeated(override(run, [blackouts, f"pushes=[[{last}, 8, 0.03, 0.0], [leader, 3, 0.0, -0.012]]"]))


def test_the_command_gives_each_follower_its_place() -> None:
    start = ["start_x_m=0.6", "start_y_m=0.3", "leader.timesteps=8"]
    assert_repeated(override(load_track("two"), [*start, "followers=2", "slots=[[0.32, -0.05], [0.33, -0.02]]"]))


def assert_repeated(run: Scenario) -> None:
    found = repetition(run_metadata(run))
    assert found is not None
    assert found.missed == ()
    again = repeated(found.command)
    assert again.by_node() == run.by_node()
    assert again.slots == run.slots
    for robot in run.robots[1:]:
        assert again.setup.blackouts_of(robot) == run.setup.blackouts_of(robot)


def test_one_refused_parameter_keeps_no_other_from_the_command() -> None:
    details = run_metadata(override(load_track("two"), ["predictor.forgetting=0.9"]))
    nodes = json.loads(details["parameters"])
    nodes["drive"]["wheel_speed_rad_s"] = "fast"
    found = repetition({**details, "parameters": json.dumps(nodes)})
    assert found is not None
    assert found.missed == ("drive.wheel_speed_rad_s",)
    assert found.command == "formation run --track two --set predictor.forgetting=0.9"


def test_a_parameter_that_is_gone_is_named() -> None:
    details = run_metadata(load_track("two"))
    nodes = json.loads(details["parameters"])
    nodes["drive"]["of_old"] = 1
    found = repetition({**details, "parameters": json.dumps(nodes)})
    assert found is not None
    assert found.missed == ("drive.of_old",)
    assert found.command == "formation run --track two"


@pytest.mark.parametrize("parameters", ["", "{}", "nonsense", '{"world": {"seed": "<script>"}}'])
def test_a_run_that_does_not_tell_its_parameters_has_no_command(parameters: str) -> None:
    assert repetition({"scenario": "track_two", "parameters": parameters}) is None


def test_nonsense_among_the_parameters_gives_no_command_or_names_what_is_missed() -> None:
    details = run_metadata(load_track("two"))
    for node, name, value in (
        ("world", "robots", []),
        ("world", "start_heading_rad", ["x"]),
        ("predictor", "name", {"a": "<b>"}),
        ("world", "surface", "no such"),
    ):
        nodes = json.loads(details["parameters"])
        nodes[node][name] = value
        found = repetition({**details, "parameters": json.dumps(nodes)})
        assert found is None or f"{node}.{name}" in found.missed


def test_changed_parameters_are_those_that_are_not_the_defaults() -> None:
    settings = ["predictor.forgetting=0.9", "world.motor.drive_mode=pid", "fine_tuner.look.frames=30"]
    before = {each.name for each in changed_parameters(run_metadata(load_track("one")))}
    found = {each.name: each for each in changed_parameters(run_metadata(override(load_track("one"), settings)))}
    assert set(found) - before == {"predictor.forgetting", "world.motor.drive_mode", "fine_tuner.look.frames"}
    look = found["fine_tuner.look.frames"]
    assert (look.value, look.default) == (30, 22)
    assert look.description
    assert before <= set(found)
    assert not [name for name in before if name.startswith(("drive.", "predictor.", "block_detector."))]


def test_a_parameter_that_no_node_has_is_listed_without_default() -> None:
    details = {"parameters": '{"drive": {"of_old": 1}, "of_yore": {"x": 2}, "broken": 3}'}
    assert changed_parameters(details) == [
        ChangedParameter("drive.of_old", 1, None),
        ChangedParameter("of_yore.x", 2, None),
    ]
