"""The base install, in an environment of its own: it analyses bags and forecasts without PyBullet and ROS."""

import json
import os
import re
import subprocess
import sys
import venv
from pathlib import Path

import pytest

from repository import ROOT
from source_copy import build_archive, copy_source

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("base_install")]
SAMPLE = ROOT / "bags" / "samples" / "track_two_formation"
# What would make an environment find more than it has.
_OTHERS = ("PYTHONPATH", "PYTHONHOME", "AMENT_PREFIX_PATH", "LD_LIBRARY_PATH", "VIRTUAL_ENV")


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the executables of a new environment in which pip has installed the wheel."""
    wheel = build_archive("wheel", copy_source(tmp_path_factory.mktemp("source")), tmp_path_factory.mktemp("built"))
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=True, symlinks=True)
    pip = [str(folder / "bin" / "python"), "-m", "pip", "--no-input", "--disable-pip-version-check", "--retries", "1"]
    reached = call([*pip, "download", "--quiet", "--no-deps", "--dest", str(folder / "reached"), "argcomplete"], folder)
    if reached.returncode != 0:
        pytest.skip(f"pip reaches no packages: {reached.stderr.strip().splitlines()[-1]}")
    done = call([*pip, "install", "--quiet", str(wheel)], folder)
    assert done.returncode == 0, done.stderr
    return folder / "bin"


def call(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, with none of this process's Python and ROS variables."""
    variables = {name: value for name, value in os.environ.items() if name not in _OTHERS}
    return subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True, check=False)


def said(command: list[str], folder: Path) -> str:
    done = call(command, folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_has_neither_pybullet_nor_ros(environment: Path, tmp_path: Path) -> None:
    code = (
        "import robot_formation, importlib.util as u; print([u.find_spec(m) for m in ('pybullet', 'rclpy', 'viser')])"
    )
    assert said([str(environment / "python"), "-c", code], tmp_path) == "[None, None, None]\n"


def test_importing_it_loads_no_library(environment: Path, tmp_path: Path) -> None:
    code = "import sys, robot_formation; print([m for m in ('numpy', 'cv2', 'matplotlib') if m in sys.modules])"
    assert said([str(environment / "python"), "-c", code], tmp_path) == "[]\n"


def test_only_commands_with_a_prefix_are_on_the_path(environment: Path) -> None:
    own = {file.name for file in environment.iterdir() if "robot_formation" in text_of(file)}
    assert "formation" in own
    assert [name for name in own if not re.fullmatch(r"formation(-[a-z]+)*", name)] == []
    executables = {file.name for file in (environment.parent / "lib" / "robot_formation").iterdir()}
    assert {name.removeprefix("formation-").replace("-", "_") for name in own} == executables


def text_of(file: Path) -> str:
    return file.read_text(errors="replace") if file.is_file() and file.stat().st_size < 10_000 else ""


def test_it_analyses_a_bag_to_the_same_figures(environment: Path, tmp_path: Path) -> None:
    words = ["analyze", str(SAMPLE), "--json"]
    found = json.loads(said([str(environment / "formation"), *words], tmp_path))
    here = json.loads(said([sys.executable, "-m", "robot_formation.cli", *words], ROOT))
    assert found["outcome"] == "done"
    for name, value in here["totals"].items():
        assert found["totals"][name] == (pytest.approx(value, rel=1e-9) if isinstance(value, float) else value)


def test_it_forecasts_a_log(environment: Path, tmp_path: Path) -> None:
    rows = [[0.002 * (-1) ** t, 0.05 + 0.001 * t] for t in range(12)]
    lines = [",".join(map(str, row)) for row in rows]
    (tmp_path / "log.csv").write_text("\n".join(["u_m,v_m", *lines]) + "\n")
    words = ["predict", "log.csv", "--predictors", "previous,measured", "--json"]
    found = json.loads(said([str(environment / "formation"), *words], tmp_path))["predictors"]
    assert found["previous"]["forecast"] == [None, *rows[:-1]]  # persistence: the row before
    assert len(found["measured"]["forecast"]) == len(rows)


def test_a_run_says_what_to_install(environment: Path, tmp_path: Path) -> None:
    done = call([str(environment / "formation"), "run", "--in-process"], tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line == "formation run: this needs ROS 2 and PyBullet: pip install 'robot_formation[ros,sim]'"


def test_an_extra_is_known_to_the_installed_package(environment: Path, tmp_path: Path) -> None:
    code = "from importlib.metadata import metadata as m; print(*m('robot_formation').get_all('Provides-Extra'))"
    extras = said([str(environment / "python"), "-c", code], tmp_path).split()
    assert {"all", "dask", "pip", "ros", "sim", "test", "view"} <= set(extras)
