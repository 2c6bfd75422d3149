"""What was run, in sentences: places, blackouts and pushes as the run tells them."""

import json
from pathlib import Path

import pytest

from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.run_record import FollowerRecord, RunRecord
from robot_formation.experiment.scenario import load, override, presets
from robot_formation.launching.processes import run_metadata
from robot_formation.reporting.runs import Run
from robot_formation.reporting.words import what_was_run


def run_with(details: dict[str, str], followers: int) -> Run:
    record = RunRecord((), tuple(FollowerRecord(f"follower_{n}") for n in range(1, followers + 1)), details=details)
    return Run(1, Path("bag"), record, analyse(record))


def test_places_blackouts_and_pushes_are_told() -> None:
    settings = ["blackouts=[[5, 2], [9, 1], [follower_2, 11, 1]]", "pushes=[[follower_2, 8, 0.03, -0.01]]"]
    details = run_metadata(override(load(presets()["echelon_of_three"]), settings))
    said = what_was_run(run_with(details, 3))
    for text in (
        "3 followers keep their places in a row, each 32.0 cm to the right of the robot before it and 5.0 cm behind",
        "No follower had a camera in timesteps 5 to 6 and 9.",
        "Follower 2 had no camera in timestep 11.",
        "Follower 2 was pushed by 3.0 cm ahead and -1.0 cm to the left in timestep 8.",
    ):
        assert text in said


@pytest.mark.parametrize(
    ("slots", "text"),
    [
        ([[0.32, 0.0]], "One follower keeps its place 32.0 cm to the right of the leader."),
        (
            [[0.32, 0.0], [0.32, 0.0], [0.35, 0.02]],
            "in a row: follower 1 and follower 2 32.0 cm to the right of the robot before it; follower 3 35.0 cm to "
            "the right of the robot before it and 2.0 cm ahead of it.",
        ),
    ],
)
def test_each_place_is_told_once(slots: list[list[float]], text: str) -> None:
    assert text in what_was_run(run_with({"slots": json.dumps(slots)}, len(slots)))


@pytest.mark.parametrize("nonsense", [3, "x", [1, "x"], [[1]], {"a": 1}, None])
def test_nonsense_is_left_out(nonsense: object) -> None:
    parameters = {"fine_tuner": {"blackouts": nonsense}, "world": {"pushes": nonsense}}
    details = {"parameters": json.dumps(parameters), "own_blackouts": json.dumps({"follower_1": nonsense})}
    said = what_was_run(run_with(details, 1))
    assert "camera in" not in said
    assert "pushed" not in said
