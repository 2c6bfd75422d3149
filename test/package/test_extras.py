"""What an extra brings is needed by its own uses only, and its absence is told in one line."""

import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from project_table import project
from repository import DATA, PACKAGE, ROOT
from robot_formation.extras import _EXTRAS, MissingExtraError, require

SAMPLE = ROOT / "bags" / "samples" / "track_two_formation"
OTHER = ROOT / "bags" / "samples" / "track_two_measured"
PICTURE = DATA / "pixy2" / "G1_04_perspective.webp"


@pytest.fixture
def base(tmp_path: Path) -> dict[str, str]:
    """Variables of a Python that can import nothing of the extras, whatever is installed."""
    keys = [element.text or "" for element in ElementTree.parse(ROOT / "package.xml").getroot().iter()]
    ros = [key for key in keys if re.fullmatch(r"rclpy|ament_index_python|launch\w*|\w+_(msgs|srvs|interfaces)", key)]
    absent = [*ros, "dask", *(module for _, module in _EXTRAS.values())]
    text = f"import sys\nsys.modules.update(dict.fromkeys({sorted(absent)!r}))\n"
    (tmp_path / "sitecustomize.py").write_text(text)
    (tmp_path / "here").mkdir()
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)]), "PWD": str(tmp_path / "here")}


def run(base: dict[str, str], *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", *map(str, arguments)]
    return subprocess.run(command, cwd=base["PWD"], env=base, capture_output=True, text=True, check=False)


def test_each_extra_that_is_asked_for_is_one_of_the_package() -> None:
    assert set(_EXTRAS) <= set(project()["optional-dependencies"])


def test_all_that_is_missing_is_said_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("pybullet", "rclpy"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as one:
        require("sim")
    with pytest.raises(MissingExtraError) as both:
        require("ros", "sim")
    assert str(one.value) == "this needs PyBullet: pip install 'robot_formation[sim]'"
    assert str(both.value) == "this needs ROS 2 and PyBullet: pip install 'robot_formation[ros,sim]'"


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("--help",),
        ("list",),
        ("analyze", SAMPLE, "--out", "pictures"),
        ("compare", SAMPLE, OTHER, "--out", "pictures"),
        ("report", SAMPLE, "--out", "report.html"),
        ("info", SAMPLE),
        ("path", SAMPLE),
        ("animate", SAMPLE, "--out", "last.png"),
        ("predict", "--bag", SAMPLE, "--predictors", "measured,formation", "--json"),
        ("teach", PICTURE, "--region", "100,80,40,40", "--out", "taught.yaml"),
        ("detect", PICTURE, "--signatures", ROOT / "config" / "signatures.yaml"),
        ("run", "--help"),
        ("completion", "zsh"),
    ],
    ids=lambda words: words[0],
)
def test_what_does_not_simulate_works_without(words: tuple[object, ...], base: dict[str, str]) -> None:
    done = run(base, "robot_formation.cli", *words)
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "extras"),
    [
        (("run",), "ros,sim"),
        (("run", "--in-process"), "ros,sim"),
        (("sweep", "--seeds", "0:2"), "ros,sim"),
        (("sweep", "--seeds", "0:2", "--dask", "tcp://127.0.0.1:1", "--out", "swept"), "dask"),
        (("paper",), "ros,sim"),
        (("calibrate", "motors"), "sim"),
        (("calibrate", "encoders"), "sim"),
        (("calibrate", "vision"), "ros"),
        (("record", "-a"), "ros"),
        (("play", SAMPLE), "ros"),
        (("replay", SAMPLE), "ros"),
        (("view", SAMPLE), "view"),
        (("view", SAMPLE, "--html", "page.html"), "view"),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_what_needs_an_extra_says_so_in_one_line(words: tuple[object, ...], extras: str, base: dict[str, str]) -> None:
    done = run(base, "robot_formation.cli", *words)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert re.fullmatch(rf"formation {words[0]}: this needs .+: pip install 'robot_formation\[{extras}\]'", line)


@pytest.mark.slow
@pytest.mark.parametrize("node", ["world", "block_detector", "recorder", "player", "progress", "viewer"])
def test_nodes_say_it_too(node: str, base: dict[str, str]) -> None:
    done = run(base, "robot_formation.nodes", node)
    assert done.returncode == 2
    assert done.stderr.splitlines() == ["this needs ROS 2: pip install 'robot_formation[ros]'"]


@pytest.mark.slow
def test_the_doctor_names_what_a_run_lacks(base: dict[str, str]) -> None:
    done = run(base, "robot_formation.cli", "doctor", "--json")
    assert done.returncode == 2
    assert {"rclpy is not installed", "pybullet is not installed"} <= set(json.loads(done.stdout)["missing"])
    assert "pip install 'robot_formation[sim,ros]'" in done.stderr


@pytest.mark.slow
def test_modules_other_than_the_nodes_can_be_imported_or_say_what_they_need(base: dict[str, str]) -> None:
    modules = [
        ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for file in sorted(PACKAGE.rglob("*.py"))
        if file.name != "__main__.py" and "nodes" not in file.parts
    ]
    program = """
import importlib, json, sys
from robot_formation.extras import MissingExtraError
refused = []
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except MissingExtraError:
        refused.append(name)
print(json.dumps(refused))
"""
    command = [sys.executable, "-c", program, *modules]
    done = subprocess.run(command, cwd=base["PWD"], env=base, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    refused = {name.split(".")[1] for name in json.loads(done.stdout)}
    # Libraries and analyses are free of both; what holds a simulation or messages isn't.
    simulating = {"world", "components", "calibration", "experiment", "paper"}
    assert refused <= {*simulating, "conversions", "viewing", "launching"}
