"""The sample bags: whole runs that today's code would make again, few and small."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from repository import ROOT
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.reader import read_bag
from robot_formation.experiment.recorded_run import Recording
from robot_formation.experiment.replay import replay_detector, replay_predictor
from robot_formation.experiment.replay_fine_tuner import replay_fine_tuner
from robot_formation.geometry.se2 import Motion
from robot_formation.names import IMAGE_TYPE, PREDICTION

pytestmark = pytest.mark.slow

FOLDER = ROOT / "bags" / "samples"
BAGS = sorted(path.name for path in FOLDER.iterdir() if (path / "metadata.yaml").is_file()) if FOLDER.is_dir() else []
MOST_BYTES = 9_000_000
MAKE_ANEW = "make them anew if this is meant: python bench/make_sample_bags.py"


def load_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_sample_bags", ROOT / "bench" / "make_sample_bags.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


SCRIPT = load_script()
SAMPLES = SCRIPT.SAMPLES


def same(one: Motion | None, other: Motion | None) -> bool:
    """Whether two motions are the same to the tolerance between machines."""
    if one is None or other is None:
        return one is other
    return all(abs(getattr(one, axis) - getattr(other, axis)) <= SCRIPT.TOLERANCE for axis in ("x_m", "y_m", "yaw_rad"))


def test_there_is_a_bag_of_every_sample() -> None:
    assert sorted(SAMPLES) == BAGS


@pytest.mark.parametrize("name", BAGS)
def test_a_sample_is_a_whole_run_of_its_scenario(name: str) -> None:
    scenario = SAMPLES[name].scenario()
    figures = SCRIPT.analysis_of(FOLDER / name)
    assert figures["outcome"] == "done"
    assert len(figures["timesteps"]) == scenario.leader.timesteps
    with read_bag(FOLDER / name) as bag:
        details = bag.metadata(METADATA_NAME)
    assert re.fullmatch("[0-9a-f]{40}", details["git_commit"]), "make it from a clean checkout"
    assert details["predictor"] == scenario.predictor.name
    assert json.loads(details["parameters"])["fine_tuner"]["mode"] == "paper"


@pytest.mark.parametrize("name", BAGS)
def test_todays_predictor_and_fine_tuner_answer_a_sample_as_it_was_answered(name: str) -> None:
    with read_bag(FOLDER / name) as bag:
        recording = Recording(bag)
        (predictions,) = replay_predictor(recording, {})
        (decisions,) = replay_fine_tuner(recording, {})
        covariances = [message.pose.covariance for message in recording.messages("follower_1", PREDICTION)]
    today = [message.pose.covariance for message in predictions.sent]
    np.testing.assert_allclose(today, covariances, rtol=0.0, atol=SCRIPT.TOLERANCE, err_msg=MAKE_ANEW)
    changed = [row.timestep for row in predictions.rows if not same(row.recorded, row.today)]
    for row in decisions.rows:
        pairs = zip(row.recorded.moves, row.today.moves, strict=False)
        moves = len(row.recorded.moves) == len(row.today.moves) and all(same(*pair) for pair in pairs)
        changed += [] if moves and row.recorded.states == row.today.states else [row.timestep]
    assert changed == [], MAKE_ANEW


def test_todays_detector_finds_the_blocks_of_the_pictures() -> None:
    with read_bag(FOLDER / "pictures") as bag:
        (detections,) = replay_detector(Recording(bag), {})
    assert len(detections.rows) > 10
    assert detections.changed == 0, MAKE_ANEW


def test_the_short_sample_is_what_its_run_gives_today() -> None:
    # The long ones take their time: the script looks at them when it is asked.
    assert SCRIPT.changes(SAMPLES["pictures"], FOLDER) == [], MAKE_ANEW


def test_the_script_tells_which_samples_are_others_today(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["make_sample_bags.py", "--check", "--only", "pictures"]
    monkeypatch.setattr(sys, "argv", arguments)
    assert SCRIPT.main() == 0
    assert capsys.readouterr().out == "pictures: as today\n"
    monkeypatch.setattr(SCRIPT, "SEED", 4)
    assert SCRIPT.main() == 1
    assert "differences, as ." in capsys.readouterr().out


@pytest.mark.parametrize("name", BAGS)
def test_a_sample_has_pictures_only_if_it_is_to_have_some(name: str) -> None:
    with read_bag(FOLDER / name) as bag:
        pictures = sum(topic.message_count for topic in bag.contents if topic.type_name == IMAGE_TYPE)
    assert (pictures > 0) == SAMPLES[name].images


def test_the_samples_are_a_few_megabytes() -> None:
    assert sum(file.stat().st_size for name in BAGS for file in (FOLDER / name).iterdir()) < MOST_BYTES


def test_differences_are_found() -> None:
    one = {"a": [1.0, {"b": "x"}], "c": None}
    assert list(SCRIPT.differences(one, {"a": [1.0 + 1e-10, {"b": "x"}], "c": None})) == []
    assert len(list(SCRIPT.differences(one, {"a": [1.0 + 1e-8, {"b": "y"}], "c": 0.0}))) == 3


@pytest.mark.parametrize(
    ("path", "ignored"),
    [
        ("bags/run_of_today/run_of_today_0.mcap", True),
        ("bags/samples/pictures/pictures_0.mcap", False),
        ("bags/samples/pictures/metadata.yaml", False),
        ("bags/samples/pictures_analysis/trajectory.png", True),
        ("bags/samples/pictures.partial/pictures_0.mcap", True),
        ("bags/README.md", False),
    ],
)
def test_git_keeps_the_samples_and_ignores_runs(path: str, ignored: bool) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    code = subprocess.run(["git", "check-ignore", "-q", path], cwd=ROOT).returncode
    assert (code == 0) == ignored


@pytest.mark.graph
@pytest.mark.xdist_group("sample_bags")
def test_the_script_makes_a_bag_in_the_place_of_the_old_one(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "old").touch()
    command = [
        sys.executable,
        str(ROOT / "bench" / "make_sample_bags.py"),
        "--out",
        str(tmp_path),
        "--only",
        "pictures",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert result.returncode == 0, result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pictures"]
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == ["metadata.yaml", "pictures_0.mcap"]
    assert SCRIPT.changes(SAMPLES["pictures"], tmp_path) == []
