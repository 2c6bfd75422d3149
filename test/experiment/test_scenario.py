"""Scenarios: presets that load, files that agree with the code, overrides, and one line for everything wrong."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import jsonschema
import pytest
import yaml

from robot_formation.components.catalogue import KINDS
from robot_formation.errors import FormationError
from robot_formation.experiment import node_defaults as module
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.experiment.scenario import (
    Scenario,
    load,
    load_track,
    override,
    presets,
    track_names,
    with_option,
    with_surface,
)
from robot_formation.experiment.scenario_json_schema import scenario_schema
from robot_formation.experiment.scenario_setup import Setup
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.koopman.predictors import NAMES, PredictorParameters
from robot_formation.parameters import from_mapping, specs, to_mapping
from robot_formation.paths import config_dir
from robot_formation.surface import SURFACES
from robot_formation.vision.marker import MarkerKind
from robot_formation.world.parameters import CameraMode

# What a scenario's setup fixes, so that config/ need not (and must not) say it.
FIXED = {
    "world": {"seed", "robots", "start_x_m", "start_y_m", "start_heading_rad"},
    "leader": {"followers"},
    "fine_tuner": {"done_listeners"},
    "overhead_tracker": {"robots", "start_x_m", "start_y_m"},
}


@pytest.fixture
def track_two() -> Scenario:
    return load_track("two")


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def to_file(text: str) -> Path:
        path = tmp_path / "mine.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


def one_line(action: Callable[..., object], *arguments: object) -> str:
    """The text of the error that an action ends with; one line of the project's own errors."""
    with pytest.raises(FormationError) as caught:
        action(*arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# --- what is shipped --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(presets()))
def test_every_preset_loads_and_checks_and_is_called_like_its_file(name: str) -> None:
    found = load(presets()[name])
    found.check()
    assert found.setup.name == name


def test_tracks_are_the_presets_that_are_called_so() -> None:
    assert set(track_names()) == {"one", "two", "one_baseline", "two_baseline"}


@pytest.mark.parametrize(
    ("track", "x_m", "y_m", "heading_deg", "timesteps"),
    [
        ("one", 0.763, 0.158, 90.0, 15),
        ("two", 1.412, 0.111, 135.0, 20),
        ("one_baseline", 0.769, 0.173, 90.0, 15),
        ("two_baseline", 1.397, 0.163, 135.0, 20),
    ],
)
def test_tracks_start_where_the_papers_do(
    track: str, x_m: float, y_m: float, heading_deg: float, timesteps: int
) -> None:
    found = load_track(track)
    setup = found.setup
    assert (setup.start_x_m, setup.start_y_m, setup.heading_deg) == (x_m, y_m, heading_deg)
    leader = found.leader
    assert (leader.timesteps, leader.step_m) == (timesteps, 0.05)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_config_files_hold_only_what_differs_from_the_code_and_what_the_setup_does_not_fix(kind: str) -> None:
    defaults = to_mapping(KINDS[kind].parameter_class()())
    given = node_defaults(kind)
    assert not set(given) & FIXED.get(kind, set())
    assert [name for name, value in given.items() if value == defaults[name]] == []


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_config_files_are_ros_parameter_files_for_any_node_name(kind: str) -> None:
    path = config_dir() / f"{kind}.yaml"
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert list(content) == ["/**"]
    assert list(content["/**"]) == ["ros__parameters"]


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_config_files_hold_valid_values(kind: str) -> None:
    from_mapping(KINDS[kind].parameter_class(), node_defaults(kind), where=kind)


def test_the_detector_is_tuned_as_in_the_paper() -> None:
    found = load_track("two").block_detector
    assert found.signature_range == (5.0, 6.0, 6.0)
    assert (found.block_filtering, found.max_merge_dist, found.min_block_area) == (40, 4, 20)
    assert found.signature_teach_threshold == 5600


def test_the_same_length_has_the_same_value_in_every_node(track_two: Scenario) -> None:
    world, drive, tuner, predictor = track_two.world, track_two.drive, track_two.fine_tuner, track_two.predictor
    assert drive.wheel_radius_m == world.wheels.radius_m
    assert drive.wheel_lever_m == pytest.approx((world.wheels.wheelbase_m + world.wheels.track_m) / 2)
    assert drive.encoder_radius_m == world.encoder_wheels.diameter_m / 2
    assert drive.encoder_v_offset_m == world.encoder_wheels.v_wheel_y_m
    assert drive.encoder_u_offset_m == world.encoder_wheels.u_wheel_x_m
    assert drive.wheel_speed_rad_s <= world.motor.max_speed_rad_s
    assert tuner.max_u_m <= drive.max_u_m == predictor.max_u_m
    assert tuner.max_v_m <= drive.max_v_m == predictor.max_v_m
    assert tuner.alignment.max_v_step_m <= drive.max_v_m
    assert tuner.alignment.max_u_step_m <= drive.max_u_m
    assert tuner.first_step_m == track_two.leader.step_m
    lens_to_face = FORMATION_DISTANCE_M - world.marker.edge_m / 2 - world.camera.y_m
    assert tuner.alignment.distance_m == pytest.approx(lens_to_face)


def test_the_schema_of_scenario_files_takes_the_presets_and_refuses_what_load_refuses(
    write: Callable[[str], Path],
) -> None:
    schema = json.loads((config_dir() / "scenario.schema.json").read_text(encoding="utf-8"))
    assert schema == scenario_schema()
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    for path in presets().values():
        assert not list(validator.iter_errors(yaml.safe_load(path.read_text(encoding="utf-8"))))
    good = {"seed": 3, "marker": "tags", "world": {"camera": {"mode": "on_demand"}, "motor.drive_mode": "pid"}}
    assert not list(validator.iter_errors(good))
    for wrong in (
        {"sead": 3},
        {"seed": -1},
        {"marker": "tag"},
        {"predictor": {"nam": "measured"}},
        {"world": {"camera": {"mode": "steam"}}},
        {"world": {"robots": ["leader"]}},
        {"block_detector": {"signature_range": ["wide"]}},
    ):
        assert list(validator.iter_errors(wrong)), wrong
        one_line(load, write(yaml.safe_dump(wrong)))


# --- the formation ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, 90.0, 135.0, -120.0])
@pytest.mark.parametrize("followers", [1, 2, 9])
def test_each_follower_starts_32_cm_to_the_right_of_its_neighbour_with_the_same_heading(
    track_two: Scenario, followers: int, heading_deg: float
) -> None:
    found = override(track_two, [f"followers={followers}", f"heading_deg={heading_deg}"])
    world = found.world
    assert list(world.robots) == ["leader", *(f"follower_{n}" for n in range(1, followers + 1))] == found.robots
    assert world.start_heading_rad == pytest.approx((math.radians(heading_deg),) * (followers + 1))
    heading = math.radians(heading_deg)
    for n in range(followers):
        dx = world.start_x_m[n + 1] - world.start_x_m[n]
        dy = world.start_y_m[n + 1] - world.start_y_m[n]
        assert math.cos(heading) * dx + math.sin(heading) * dy == pytest.approx(0.0, abs=1e-12)  # nothing forward
        assert -math.sin(heading) * dx + math.cos(heading) * dy == pytest.approx(-0.32)  # to the right
    assert (world.start_x_m[0], world.start_y_m[0]) == (1.412, 0.111)


def test_the_leader_waits_for_every_follower_and_each_tick_has_its_listeners(track_two: Scenario) -> None:
    found = override(track_two, ["followers=3"])
    assert found.leader.followers == ("follower_1", "follower_2", "follower_3")
    listeners = {robot: found.of_robot(KINDS["fine_tuner"], robot).done_listeners for robot in found.robots[1:]}
    assert listeners == {"follower_1": 2, "follower_2": 2, "follower_3": 1}


# --- files and overrides ----------------------------------------------------------------------------------------------


def test_a_file_says_only_what_differs_and_is_called_like_itself(write: Callable[[str], Path]) -> None:
    found = load(write("seed: 7\npredictor:\n  name: previous\nworld:\n  camera: {mode: on_demand}\n"))
    assert found.setup == Setup(name="mine", seed=7)
    assert found.settings["predictor"] == {"name": "previous"}
    assert found.settings["world"] == {"camera.mode": "on_demand"}
    assert found.predictor == PredictorParameters(name="previous")
    assert found.world.seed == 7


def test_an_override_beats_the_file_which_beats_config_which_beats_the_code(write: Callable[[str], Path]) -> None:
    path = write("predictor:\n  forgetting: 0.9\n  sigma_u_m: 0.001\n")
    found = override(load(path), ["predictor.forgetting=0.8"]).predictor
    assert (found.forgetting, found.sigma_u_m, found.max_u_m) == (0.8, 0.001, 0.1)
    assert load(path).block_detector.block_filtering == 40
    assert KINDS["block_detector"].parameter_class()().block_filtering == 3


def test_the_last_of_several_overrides_counts_and_the_scenario_itself_is_not_changed(track_two: Scenario) -> None:
    found = override(track_two, ["predictor.forgetting=0.8", "seed=3", "predictor.forgetting=0.7", "seed=4"])
    assert found.predictor.forgetting == 0.7
    assert found.setup.seed == 4
    assert track_two.setup.seed == 0
    assert "forgetting" not in track_two.settings.get("predictor", {})


def test_values_of_overrides_are_yaml(track_two: Scenario) -> None:
    settings = ["block_detector.signature_range=[1, 2.5]", "world.sleep=false", "name=my run", "drive.max_v_m=0.1"]
    found = override(track_two, settings)
    assert found.block_detector.signature_range == (1.0, 2.5)
    assert found.world.sleep is False
    assert found.setup.name == "my run"
    assert found.drive.max_v_m == 0.1


def test_a_value_may_hold_an_equals_sign(track_two: Scenario) -> None:
    found = override(track_two, ["world.surface=plane", "world.surface_parameters=['height_m=0.2']"])
    found.check()
    assert found.world.surface_parameters == ("height_m=0.2",)


@pytest.mark.parametrize("surface", sorted(SURFACES))
def test_another_surface_comes_with_its_own_defaults(track_two: Scenario, surface: str) -> None:
    found = with_surface(override(track_two, ["world.surface_parameters=['height_m=0.2']"]), surface)
    assert found.world.surface == surface
    assert found.world.surface_parameters == ()
    found.check()


def test_every_predictor_can_be_chosen(track_two: Scenario) -> None:
    for name in NAMES:
        assert override(track_two, [f"predictor.name={name}"]).predictor.name == name
    assert set(specs(PredictorParameters)["name"].choices) == set(NAMES)


# --- what can be wrong ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        ("seed", "--set takes KEY=VALUE, like predictor.forgetting=0.95, not 'seed'"),
        ("", "--set takes KEY=VALUE"),
        ("sed=3", "no entry 'sed'; did you mean 'seed'?"),
        ("predictor=measured", "no entry 'predictor'; did you mean 'predictor.'?"),
        ("predicter.name=measured", "no node 'predicter'; did you mean 'predictor'?"),
        (".name=x", "no node ''; there are: "),
        ("predictor.nam=measured", "no parameter 'nam'; did you mean 'name'?"),
        ("predictor.name=mesured", "'name' can't be 'mesured'; did you mean 'measured'?"),
        ("predictor.forgetting=often", "'forgetting' must be of type float, not 'often'"),
        ("predictor.forgetting=1.5", "'forgetting' is 1.5, outside 0.01 to 1.0"),
        ("predictor.forgetting=", "'forgetting' must be of type float, not None"),
        ("predictor.forgetting=.nan", "must be finite"),
        ("predictor.forgetting=[", "--set predictor.forgetting: '[' is no YAML value"),
        ("seed=!!python/object:os.system x", "is no YAML value"),
        ("seed=-1", "'seed' is -1, outside 0 to"),
        ("seed=1.5", "'seed' must be of type int"),
        ("followers=0", "'followers' is 0, outside 1 to 10"),
        ("world.camera.mod=stream", "no parameter 'camera.mod'; did you mean 'camera.mode'?"),
        ("world.camera.mode=steam", "'camera.mode' can't be 'steam'; did you mean 'stream'?"),
        ("world.mode=stream", "did you mean 'camera.mode'?"),
    ],
)
def test_a_wrong_override_is_answered_in_one_line_that_helps(track_two: Scenario, setting: str, text: str) -> None:
    assert text in one_line(override, track_two, [setting])


def test_a_misspelt_track_suggests_the_near_one() -> None:
    assert one_line(load_track, "tow").startswith("no track 'tow'; did you mean 'two'?")
    assert "there are: one, one_baseline, two, two_baseline" in one_line(load_track, "xyz")


def test_a_misspelt_surface_suggests_the_near_one(track_two: Scenario) -> None:
    assert "no surface 'bowll'; did you mean 'bowl'?" in one_line(with_surface, track_two, "bowll")
    wrong = override(track_two, ["world.surface=plain"])
    assert "did you mean 'plane'?" in one_line(wrong.check)


def test_wrong_parameters_of_a_surface_are_found_by_the_check(track_two: Scenario) -> None:
    wrong = override(track_two, ["world.surface=plane", "world.surface_parameters=['heigth_m=0.1']"])
    assert "did you mean 'height_m'?" in one_line(wrong.check)
    wrong = override(track_two, ["world.surface_parameters=['height_m']"])
    assert "are texts like 'size_m=2.0'" in one_line(wrong.check)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a scenario is a mapping"),
        ("- seed\n", "a scenario is a mapping"),
        ("seed: [1, 2\n", "no valid YAML in line"),
        ("seed: 1\n  name: x\n", "no valid YAML in line 2"),
        ("seed: !!python/object/apply:os.getcwd []\n", "no valid YAML"),
        ("sead: 1\n", "no entry 'sead'; did you mean 'seed'?"),
        ("predicter: {name: previous}\n", "no entry 'predicter'; did you mean 'predictor'?"),
        ("1: 2\n", "no entry '1'"),
        ("predictor: previous\n", "'predictor' must hold parameters of that node, not 'previous'"),
        ("predictor: {nme: previous}\n", "predictor: no parameter 'nme'; did you mean 'name'?"),
        ("predictor: {name: prevoius}\n", "did you mean 'previous'?"),
        ("seed: many\n", "'seed' must be of type int, not 'many'"),
        ("followers: 20\n", "'followers' is 20, outside 1 to 10"),
        ("name: 3\n", "'name' must be of type str, not 3"),
    ],
)
def test_a_wrong_file_is_answered_in_one_line_that_names_it(
    write: Callable[[str], Path], text: str, words: str
) -> None:
    path = write(text)
    found = one_line(load, path)
    assert found.startswith(str(path))
    assert words in found


def test_a_missing_file_a_folder_and_a_picture_are_no_scenarios(tmp_path: Path) -> None:
    assert "can't be read (No such file" in one_line(load, tmp_path / "missing.yaml")
    assert "can't be read" in one_line(load, tmp_path)
    (tmp_path / "picture.yaml").write_bytes(b"\x89PNG\xff\xfe")
    assert "no text in UTF-8" in one_line(load, tmp_path / "picture.yaml")


@pytest.mark.parametrize("text", ["", "- 1\n", "drive: {}\n", "'/**': 3\n", "'/**': {ros__parameters: 3}\n"])
def test_a_config_file_of_another_form_is_answered_with_the_form_it_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    (tmp_path / "drive.yaml").write_text(text, encoding="utf-8")
    monkeypatch.setattr(module, "config_dir", lambda: tmp_path)
    assert re.search("drive.yaml: a ROS parameter file begins with", one_line(node_defaults, "drive"))


@pytest.mark.parametrize(
    ("key", "value", "source", "message"),
    [
        ("predictor.name", "mesured", "--predictor", "--predictor can't be 'mesured'; did you mean 'measured'?"),
        ("predictor.name", "mesured", "predictor:=", "predictor:= can't be 'mesured'; did you mean 'measured'?"),
        ("seed", -1, "--seed", "--seed is -1, outside 0 to 9223372036854775807"),
        ("seed", "one", "seed:=", "seed:= must be of type int, not 'one'"),
        ("seed", "[1", "seed:=", "seed:=: '[1' is no YAML value: did not find expected ',' or ']'"),
        ("world.camera.mode", "streem", "--camera", "--camera can't be 'streem'; did you mean 'stream'?"),
        ("world.real_time_factor", -1.0, "--real-time-factor", "--real-time-factor is -1.0, outside 0.0 to 1000.0"),
    ],
)
def test_a_wrong_value_of_an_option_names_the_option_alone(key: str, value: object, source: str, message: str) -> None:
    with pytest.raises(FormationError) as raised:
        with_option(load_track("one"), key, value, source)
    assert str(raised.value) == message


def test_the_value_of_an_option_may_be_a_text() -> None:
    scenario = with_option(load_track("one"), "seed", "7", "seed:=")
    scenario = with_option(scenario, "world.real_time_factor", "2", "real_time_factor:=")
    scenario = with_option(scenario, "world.camera.mode", "on_demand", "camera:=")
    assert scenario.setup.seed == 7
    assert (scenario.world.real_time_factor, scenario.world.camera.mode) == (2.0, CameraMode.ON_DEMAND)


@pytest.mark.parametrize("setting", ["sed=3", "predicter.name=x", "predictor.nam=x", "seed", "seed=[1", "seed=x"])
def test_a_wrong_setting_names_where_it_was_written(setting: str) -> None:
    with pytest.raises(FormationError, match=r"^set:="):
        override(load_track("one"), [setting], source="set:=")


def test_a_scenario_has_a_field_for_every_node_in_the_catalogues_order() -> None:
    given = [field.name for field in fields(Scenario) if field.name not in ("setup", "settings", "given")]
    assert given == list(KINDS)


def test_every_kind_of_marker_may_have_defaults_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    head = "/**:\n  ros__parameters:\n"
    (tmp_path / "drive.yaml").write_text(f"{head}    max_v_m: 0.1\n    max_u_m: 0.1\n")
    for marker in MarkerKind:
        (tmp_path / marker.value).mkdir()
        (tmp_path / marker.value / "drive.yaml").write_text(f"{head}    max_v_m: {len(marker.value)}\n")
    monkeypatch.setattr(module, "config_dir", lambda: tmp_path)
    for marker in MarkerKind:
        assert node_defaults("drive", marker) == {"max_v_m": len(marker.value), "max_u_m": 0.1}
