"""Scenarios from Python: loaded, changed, written and read again, with what is wrong in one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_formation as rf
from robot_formation.experiment.scenario import load_track, override


def test_changes_are_those_of_the_command_line() -> None:
    changed = rf.load_scenario("track_two").changed(
        seed=3,
        predictor="measured",
        followers=1,
        surface="plane",
        schedule="together",
        camera="on_demand",
        timesteps=7,
        settings={"predictor.forgetting": 0.95, "world": {"imperfections.motor_gain": 0}},
    )
    settings = ["world.surface=plane", "seed=3", "predictor.name=measured", "schedule=together", "leader.timesteps=7"]
    settings += ["world.camera.mode=on_demand", "predictor.forgetting=0.95", "world.imperfections.motor_gain=0"]
    assert changed.definition.by_node() == override(load_track("two"), settings).by_node()
    said = (changed.seed, changed.predictor, changed.followers, changed.surface, changed.path, changed.timesteps)
    assert said == (3, "measured", 1, "plane", "straight", 7)
    assert changed.settings["predictor.forgetting"] == changed.parameters["predictor.forgetting"] == 0.95
    default = {"predictor.sigma_discount": changed.parameters["predictor.sigma_discount"]}
    assert changed.changed() == changed == changed.changed(settings=default)
    assert changed != "track_two"
    assert changed.changed(seed=4) != changed


def test_a_change_leaves_the_scenario_itself_as_it_was() -> None:
    scenario = rf.load_scenario("track_two")
    before = scenario.to_dict()
    scenario.changed(seed=9, settings={"leader.timesteps": 3})
    scenario.to_dict()["leader"]["timesteps"] = 1
    assert scenario.to_dict() == before
    assert scenario.timesteps == 20


def test_values_of_numpy_are_taken() -> None:
    settings = {"predictor.forgetting": np.float64(0.9), "leader.timesteps": np.int64(4)}
    changed = rf.load_scenario("track_two").changed(seed=np.int64(5), settings=settings)  # type: ignore[arg-type]
    assert changed == rf.load_scenario("track_two").changed(seed=5, timesteps=4, settings={"predictor.forgetting": 0.9})


@pytest.mark.parametrize("name", rf.scenarios())
def test_every_scenario_of_the_package_is_the_same_when_written_and_read_again(name: str, tmp_path: Path) -> None:
    scenario = rf.load_scenario(name)
    assert rf.load_scenario(scenario.save(tmp_path / "mine.yaml")) == scenario
    assert rf.Scenario.from_dict(scenario.to_dict()) == scenario


def test_a_changed_scenario_is_the_same_when_written_and_read_again(tmp_path: Path) -> None:
    slots = [[0.32, -0.1], [0.33, 0.0], [0.32, 0.0]]
    settings = {"formation": "abreast", "slots": slots, "predictor.forgetting": 0.1 + 0.2}
    scenario = rf.load_scenario("echelon_of_three").changed(seed=2**40, settings=settings)
    assert rf.load_scenario(scenario.save(tmp_path / "mine.yaml")) == scenario
    path = rf.load_scenario("track_two").changed(path="circle", settings={"fine_tuner.mode": "precise"})
    assert "start_x_m" not in path.to_dict()  # it follows from the path
    assert rf.Scenario.from_dict(path.to_dict()) == path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"predictor": "mesured"}, ["predictor can't be 'mesured'", "did you mean 'measured'"]),
        ({"surface": "bowll"}, ["no surface 'bowll'", "did you mean 'bowl'"]),
        ({"path": "circel"}, ["circel", "did you mean 'circle'"]),
        ({"seed": "x"}, ["seed must be of type int, not 'x'"]),
        ({"seed": -1}, ["seed is -1, outside 0 to"]),
        ({"settings": {"wrld.seed": 1}}, ["settings: no node 'wrld'", "did you mean 'world'"]),
        ({"settings": {"sead": 1}}, ["settings: no entry 'sead'", "did you mean 'seed'"]),
        ({"settings": {"leader.timstep": 1}}, ["settings: leader: no parameter 'timstep'", "'timesteps'"]),
        ({"settings": {"leader.timesteps": "five"}}, ["'timesteps' must be of type int, not 'five'"]),
        ({"settings": ["leader.timesteps=5"]}, ["settings is a mapping"]),
        ({"timesteps": 400}, ["would leave the plate"]),
    ],
)
def test_what_is_wrong_is_told_in_a_line(change: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(rf.FormationError) as error:
        rf.load_scenario("track_two").changed(**change)
    assert [word for word in words if word not in str(error.value)] == []
    assert "\n" not in str(error.value)


def test_a_scenario_that_is_not_there_or_can_not_be_written(tmp_path: Path) -> None:
    with pytest.raises(rf.FormationError, match="did you mean 'track_two'"):
        rf.load_scenario("track_too")
    with pytest.raises(rf.FormationError, match="scenario: no entry 'sead'; did you mean 'seed'"):
        rf.Scenario.from_dict({"sead": 1})
    with pytest.raises(rf.FormationError, match="can't be written"):
        rf.load_scenario("track_two").save(tmp_path / "missing" / "mine.yaml")


def test_a_scenario_says_what_it_is() -> None:
    said = repr(rf.load_scenario("echelon_of_three"))
    assert said == (
        "<Scenario 'echelon_of_three', predictor formation, surface bowl, path straight, seed 0, 3 followers, "
        "15 timesteps>"
    )


@pytest.mark.parametrize("value", [None, 3, b"track_two"])
def test_what_is_no_path_or_mapping_is_refused(value: Any) -> None:
    for function in (rf.load_scenario, rf.load_scenario("track_two").save, rf.analyze, rf.load_sweep):
        with pytest.raises(rf.FormationError, match="is a path, not"):
            function(value)
    with pytest.raises(rf.FormationError, match="is a mapping, like"):
        rf.Scenario.from_dict(value)
