"""The sample bags: each is what its run gives today, and they are few and small."""

import importlib.util
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.report import to_json
from robot_formation.bag.reader import read_bag
from robot_formation.experiment.in_process import run_in_process
from robot_formation.launching.processes import run_metadata
from robot_formation.names import IMAGE_TYPE

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "bags" / "samples"
BAGS = sorted(path.name for path in FOLDER.iterdir() if (path / "metadata.yaml").is_file()) if FOLDER.is_dir() else []
MOST_BYTES = 9_000_000


def load_script():
    spec = importlib.util.spec_from_file_location("make_sample_bags", ROOT / "bench" / "make_sample_bags.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


SAMPLES = load_script().SAMPLES


def analysis_of(bag):
    return json.loads(to_json(analyse(load_run(bag))))


def differences(one, other, where=""):
    """Where two JSON values differ: numbers by more than 1e-9, everything else at all."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in one.keys() | other.keys():
            yield from differences(one.get(key), other.get(key), f"{where}.{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{where}[{number}]")
    elif isinstance(one, float) and isinstance(other, (int, float)):
        if not math.isclose(one, other, rel_tol=0.0, abs_tol=1e-9):
            yield f"{where}: {one} and {other}"
    elif one != other:
        yield f"{where}: {one} and {other}"


@pytest.mark.parametrize("name", BAGS)
def test_a_sample_is_what_its_run_gives_today(name, tmp_path):
    scenario = SAMPLES[name].scenario()
    result = run_in_process(scenario, tmp_path / "today", run_metadata(scenario))
    assert result.exit_code == 0
    found = list(differences(analysis_of(FOLDER / name), analysis_of(tmp_path / "today")))
    assert found == [], "make them anew if this is meant: python bench/make_sample_bags.py"


@pytest.mark.parametrize("name", BAGS)
def test_a_sample_has_pictures_only_if_it_is_to_have_some(name):
    with read_bag(FOLDER / name) as bag:
        pictures = sum(topic.message_count for topic in bag.contents if topic.type_name == IMAGE_TYPE)
    assert (pictures > 0) == SAMPLES[name].images


def test_the_samples_are_a_few_megabytes():
    assert sum(file.stat().st_size for name in BAGS for file in (FOLDER / name).iterdir()) < MOST_BYTES


def test_differences_are_found():
    one = {"a": [1.0, {"b": "x"}], "c": None}
    assert list(differences(one, {"a": [1.0 + 1e-10, {"b": "x"}], "c": None})) == []
    assert len(list(differences(one, {"a": [1.0 + 1e-8, {"b": "y"}], "c": 0.0}))) == 3


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
def test_git_keeps_the_samples_and_ignores_runs(path, ignored):
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    code = subprocess.run(["git", "check-ignore", "-q", path], cwd=ROOT).returncode
    assert (code == 0) == ignored


@pytest.mark.graph
@pytest.mark.xdist_group("graph")
def test_the_script_makes_a_bag_in_the_place_of_the_old_one(tmp_path):
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
    scenario = SAMPLES["pictures"].scenario()
    run_in_process(scenario, tmp_path / "today", run_metadata(scenario))
    assert list(differences(analysis_of(tmp_path / "pictures"), analysis_of(tmp_path / "today"))) == []
