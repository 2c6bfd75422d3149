"""The modules that are compiled: same source, same results to the last bit, and nothing is lost without a compiler."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from repository import ROOT
from robot_formation import hot_loops

PACKAGE = ROOT / "robot_formation"
RUN = """
import json, sys
import robot_formation
from robot_formation.analysis.quantities import analyse
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.scenario import load_track, override
from robot_formation.hot_loops import hot_loops
scenario = override(load_track("two"), ["leader.timesteps=4", "seed=5"])
follower = analyse(run_in_memory(scenario)).followers[0]
print(json.dumps([robot_formation.__file__, hot_loops(), [repr(t) for t in follower.timesteps], repr(follower.totals)]))
"""


def names() -> set[str]:
    """The modules that have a .pxd file."""
    return {".".join(path.relative_to(ROOT).with_suffix("").parts) for path in PACKAGE.rglob("*.pxd")}


def run_of(folder: Path) -> list[object]:
    """Where the package of a folder lies, how its hot loops run, and what a run of it yields."""
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", RUN], env=environment, cwd=folder, capture_output=True, text=True, check=True
    )
    found: list[object] = json.loads(done.stdout)
    return found


def without_compiled(folder: Path) -> Path:
    """A copy of the checkout's package without anything compiled."""
    ignored = shutil.ignore_patterns("*.so", "__pycache__")
    shutil.copytree(PACKAGE, folder / PACKAGE.name, ignore=ignored)
    for name in ("config", "launch"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for name in ("package.xml", "setup.py", "setup.cfg", "pyproject.toml", "README.md", "LICENSE", "CITATION.cff"):
        shutil.copy(ROOT / name, folder)
    for name in ("resource", "ros2_run"):
        shutil.copytree(ROOT / name, folder / name)
    return folder


def test_each_has_its_source_beside_it() -> None:
    assert names() == set(hot_loops.hot_loops())
    assert all(path.with_suffix(".py").is_file() for path in PACKAGE.rglob("*.pxd"))


def test_none_is_compiled_from_an_older_source() -> None:
    stale = [name for name, state in hot_loops.hot_loops().items() if state == hot_loops.OUT_OF_DATE]
    assert not stale, "compile them: ./formation doctor, or pip install -e ."


@pytest.mark.skipif(shutil.which(os.environ.get("CC", "cc")) is None, reason="there is no C compiler")
def test_all_are_compiled_in_a_checkout_where_there_is_a_compiler() -> None:
    assert set(hot_loops.hot_loops().values()) == {hot_loops.COMPILED}


@pytest.mark.slow
def test_a_run_is_the_same_to_the_last_bit_compiled_or_not(tmp_path: Path) -> None:
    place, states, *result = run_of(without_compiled(tmp_path))
    assert str(place).startswith(str(tmp_path))
    assert states == dict.fromkeys(names(), hot_loops.INTERPRETED)
    assert result == run_of(ROOT)[2:]


@pytest.mark.long
def test_the_package_installs_where_there_is_no_compiler(tmp_path: Path) -> None:
    source = without_compiled(tmp_path / "source")
    # What is not there can't compile.
    environment = {**os.environ, "CC": str(tmp_path / "none")}
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--wheel-dir", str(tmp_path), str(source)]
    subprocess.run(command, env=environment, capture_output=True, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    shutil.unpack_archive(wheel, tmp_path / "unpacked", "zip")
    assert list((tmp_path / "unpacked").rglob("body_and_traction.py"))
    assert not list((tmp_path / "unpacked").rglob("*.so"))
