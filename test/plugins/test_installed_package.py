"""A package of its own, installed by pip: its classes are listed, run, swept and checked; a broken one hurts nobody."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from examples import install_example
from repository import ROOT

pytestmark = pytest.mark.xdist_group("installed_package")

EXAMPLE = ROOT / "examples" / "own_classes"
SHORT = ("--set", "leader.timesteps=4", "--camera", "on_demand")


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Variables with which the example and a broken package are installed."""
    folder = tmp_path_factory.mktemp("installed")
    install_example("own_classes", folder, tmp_path_factory.mktemp("source"))
    broken = folder / "broken-1.0.dist-info"
    broken.mkdir()
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    groups = [f"[robot_formation.{kind}]\nwreck = broken_module:Wreck\n" for kind in ("predictors", "paths")]
    (broken / "entry_points.txt").write_text("\n".join(groups))
    (folder / "broken_module.py").write_text("raise RuntimeError('it is broken')\n")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder), os.environ.get("PYTHONPATH", "")])}


def formation(environment: dict[str, str], *arguments: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "robot_formation.cli", *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


def test_its_classes_are_listed_with_where_they_are_from_and_the_broken_one_with_why(
    environment: dict[str, str],
) -> None:
    found = json.loads(formation(environment, "list", "--json").stdout)
    for kind, name in (("predictors", "damped"), ("surfaces", "dunes"), ("paths", "zigzag"), ("sensors", "hsv")):
        assert re.search(r"\[package own.classes 0\.1\.0, own_classes:", found[kind][name])
    assert "period=4" in found["paths"]["zigzag"]
    assert found["predictors"]["wreck"].startswith("can't be used: predictor 'wreck' (package broken 1.0)")
    assert "RuntimeError: it is broken" in found["paths"]["wreck"]
    assert "formation" in found["predictors"]


def test_they_run_through_the_graph_as_in_process(environment: dict[str, str], tmp_path: Path) -> None:
    named = ("--predictor", "damped", "--surface", "dunes", "--path", "zigzag", "--set", "block_detector.sensor=hsv")
    tables = []
    for bag, way in (("graph", ()), ("process", ("--in-process",))):
        options = (*named, *SHORT, *way, "--seed", 3, "--bag", tmp_path / bag, "--json")
        tables.append(json.loads(formation(environment, "run", *options).stdout)["timesteps"])
    assert tables[0] == tables[1]
    assert len(tables[0]) == 4


def test_they_are_swept_with_two_jobs(environment: dict[str, str], tmp_path: Path) -> None:
    chosen = ("--tracks", "two", "--predictors", "previous,damped,damped+close", "--surfaces", "dunes")
    options = (*chosen, "--paths", "zigzag", "--seeds", "0:1", "--jobs", 2, "--set", "leader.timesteps=4")
    found = json.loads(formation(environment, "sweep", *options, "--out", tmp_path / "out", "--json").stdout)
    assert "damped+close" in json.dumps(found)


def test_the_broken_one_is_one_line_and_exit_code_2(environment: dict[str, str], tmp_path: Path) -> None:
    for option in ("--predictor", "--path"):
        done = formation(environment, "run", option, "wreck", "--in-process", "--bag", tmp_path / "bag", code=2)
        assert "wreck' (package broken 1.0): can't be imported: RuntimeError: it is broken" in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "bag").exists()


def test_its_own_checks_pass(environment: dict[str, str]) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_own_classes.py"]
    done = subprocess.run(command, cwd=EXAMPLE, env=environment, stdout=subprocess.PIPE, text=True, timeout=300)
    assert done.returncode == 0, done.stdout
