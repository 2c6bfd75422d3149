"""The conditions of a run, from its scenario or from what its bag says."""

import pytest

from robot_formation.analysis.conditions import conditions, conditions_text, run_facts
from robot_formation.experiment.scenario import load_track, override
from robot_formation.launching.processes import run_metadata

COMMON = {"marker": "colours", "followers": 1, "drive_mode": "pwm_stop"}


def test_conditions_come_out_of_what_a_run_says_of_itself() -> None:
    settings = ["fine_tuner.mode=paper", "world.camera.mode=on_demand", "followers=2", "seed=7", "marker=tags"]
    facts = run_facts(run_metadata(override(load_track("one"), settings)), in_process=True)
    assert facts == {
        "seed": 7,
        "predictor": "formation",
        "path": "straight",
        "surface": "bowl",
        "conditions": {
            "mode": "paper",
            "camera": "on_demand",
            "marker": "tags",
            "followers": 2,
            "drive_mode": "pwm_stop",
            "in_process": True,
        },
    }
    assert conditions_text(facts["conditions"]) == "alignment paper, camera on_demand, marker tags, 2 followers"


@pytest.mark.parametrize("text", ["", "no JSON", "[1]", '{"world": 3, "fine_tuner": []}', "{}"])
def test_a_bag_that_says_nothing_or_nonsense_has_unknown_conditions(text: str) -> None:
    facts = run_facts({"parameters": text, "seed": "many"})
    assert set(facts["conditions"].values()) == {None}
    assert facts["seed"] is None
    assert conditions_text(facts["conditions"]) == ""


@pytest.mark.parametrize(
    "parameters",
    [
        '{"world": {"robots": 5, "camera.mode": ["x"], "marker.kind": {"a": 1}}, "fine_tuner": {"mode": "\\ud800"}}',
        '{"world": ' * 100_000,
        "[" * 100_000,
        '{"world": {"robots": ' + "9" * 5000 + "}}",
    ],
    ids=["wrong types", "deep mappings", "deep lists", "a huge number"],
)
def test_a_bag_whose_metadata_was_made_up_has_unknown_conditions(parameters: str) -> None:
    facts = run_facts({"parameters": parameters, "seed": "9" * 5000})
    assert set(facts["conditions"].values()) == {None}
    assert facts["seed"] is None
    assert conditions_text(facts["conditions"]) == ""


def test_what_nearly_every_run_has_is_not_said() -> None:
    assert conditions_text({"mode": "precise", "camera": "stream", **COMMON}) == "alignment precise, camera stream"
    assert conditions({}) == {"mode": None, "camera": None, **dict.fromkeys(COMMON)}


def test_another_schedule_is_another_condition() -> None:
    found = run_facts(run_metadata(override(load_track("one"), ["schedule=timer", "spacing=delayed"])))["conditions"]
    assert conditions_text(found).endswith("schedule timer, spacing delayed")
