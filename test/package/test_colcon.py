"""colcon builds the package as users of a ROS workspace do."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from graph_lab import Lab, open_lab
from repository import ROOT
from robot_formation.bag.writer import BagWriter
from robot_formation.components.catalogue import KINDS
from source_copy import copy_source
from synthetic_bag import SyntheticRun

# On one core when the suite is spread: one build serves all.
pytestmark = pytest.mark.xdist_group("colcon")

# The folder of the environment's executables; not resolved, since python itself may be a link to somewhere else.
BIN = Path(sys.executable).parent


PATH = f"{BIN}{os.pathsep}{os.environ.get('PATH', '')}"
NODES = [*KINDS, "recorder", "player", "progress", "viewer"]


def run_colcon(workspace: Path, *arguments: str) -> str:
    """Call colcon in a workspace as a user does; returns what it prints."""
    colcon = shutil.which("colcon", path=PATH)
    if colcon is None:
        pytest.skip("colcon is not installed: pip install colcon-common-extensions")
    environment = {**os.environ, "PATH": PATH, "COLCON_HOME": str(workspace)}
    command = [colcon, "--log-base", str(workspace / "log"), *arguments]
    result = subprocess.run(command, cwd=workspace, env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with this source and an example's, built."""
    workspace = tmp_path_factory.mktemp("workspace")
    copy_source(workspace / "src" / "robot_formation")
    left_out = shutil.ignore_patterns("build", "*.egg-info", "__pycache__")
    shutil.copytree(ROOT / "examples" / "own_detector", workspace / "src" / "own_detector", ignore=left_out)
    run_colcon(workspace, "build")
    return workspace


@pytest.fixture(scope="module")
def installed(workspace: Path) -> Path:
    """The package's install folder."""
    return workspace / "install" / "robot_formation"


@pytest.fixture(scope="module")
def sourced(workspace: Path) -> dict[str, str]:
    """The environment of a shell that has sourced the workspace, with the ROS of this Python under it."""
    underlay = {**os.environ, "PATH": PATH}
    underlay.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    command = ["bash", "-c", f"source '{workspace}/install/setup.bash' && env -0"]
    result = subprocess.run(command, env=underlay, capture_output=True, text=True, check=True)
    return dict(entry.split("=", 1) for entry in result.stdout.split("\0") if "=" in entry)


def ros2_run(environment: Mapping[str, str], package: str, executable: str) -> Path:
    """The path that `ros2 run` starts: an executable below lib/PACKAGE of the first prefix that has the package."""
    for prefix in map(Path, environment["AMENT_PREFIX_PATH"].split(os.pathsep)):
        if (prefix / "share" / "ament_index" / "resource_index" / "packages" / package).is_file():
            files = [path for path in (prefix / "lib" / package).rglob(executable) if os.access(path, os.X_OK)]
            assert len(files) == 1, f"{executable} in {prefix}: {files}"
            return files[0]
    raise AssertionError(f"no package {package}")


def test_each_node_and_the_command_become_executables(installed: Path) -> None:
    commands = {f"formation-{node.replace('_', '-')}" for node in NODES}
    for folder, names in (("lib/robot_formation", set(NODES)), ("bin", commands)):
        assert {file.name for file in (installed / folder).iterdir()} == {*names, "formation"}
        assert all(os.access(file, os.X_OK) for file in (installed / folder).iterdir())


def test_a_sourced_workspace_has_the_command_on_its_path(sourced: dict[str, str], installed: Path) -> None:
    assert shutil.which("formation", path=sourced["PATH"]) == str(installed / "bin" / "formation")


def test_a_build_with_links_gives_the_same_executables(workspace: Path) -> None:
    linked = workspace.with_name(f"{workspace.name}_linked")
    shutil.copytree(workspace / "src", linked / "src")
    run_colcon(linked, "build", "--symlink-install")
    for folder in ("lib/robot_formation", "bin", "share/robot_formation/config"):
        here, there = (place / "install" / "robot_formation" / folder for place in (linked, workspace))
        assert {file.name for file in here.iterdir()} == {file.name for file in there.iterdir()}


def test_ros2_run_finds_the_detector_of_the_example(sourced: dict[str, str]) -> None:
    assert ros2_run(sourced, "own_detector", "detector").is_file()


def test_config_launch_and_the_index_marker_are_installed(installed: Path) -> None:
    share = installed / "share"
    assert (share / "ament_index" / "resource_index" / "packages" / "robot_formation").is_file()
    for folder in ("config", "launch"):
        here = {
            file.relative_to(ROOT)
            for file in (ROOT / folder).rglob("*")
            if file.is_file() and "__pycache__" not in file.parts
        }
        assert here
        assert all((share / "robot_formation" / file).is_file() for file in here)


def test_the_installed_command_starts_and_finds_what_was_installed_with_it(installed: Path, tmp_path: Path) -> None:
    (site_packages,) = installed.glob("lib/python3*/site-packages")
    environment = {**os.environ, "PATH": PATH, "PYTHONPATH": str(site_packages)}
    command = [str(installed / "lib" / "robot_formation" / "formation"), "doctor", "--json"]
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert str(installed / "share" / "robot_formation" / "config") in result.stdout


def test_colcon_test_finds_the_tests_and_the_linters(workspace: Path) -> None:
    chosen = ["test/test_parameters.py", "test/package/test_linters.py", " -k", "ruff or parameter"]
    run_colcon(workspace, "test", "--packages-select", "robot_formation", "--pytest-args", *chosen)
    summary = run_colcon(workspace, "test-result", "--all", "--verbose").splitlines()
    (line,) = [line for line in summary if "pytest.xml" in line]
    parts = [part.split() for part in line.partition(": ")[2].split(", ")]
    counts = {name: count for count, name in parts}
    assert (counts["errors"], counts["failures"]) == ("0", "0")
    assert int(counts["tests"]) > 10


@pytest.mark.graph
def test_ros2_run_finds_every_node_which_takes_ros_arguments_and_ends_on_ctrl_c(
    sourced: dict[str, str], installed: Path, tmp_path: Path
) -> None:
    needed = {
        "recorder": ["-p", f"path:={tmp_path / 'bag'}"],
        # In a pause: the moves in the bag would end the leader, and the bag's end the player.
        "player": ["-p", f"bag:={tmp_path / 'first'}", "-p", "paused:=true"],
    }
    with BagWriter(tmp_path / "first") as writer:
        SyntheticRun(writer)
    with open_lab(tmp_path, Lab) as lab:
        environment = {**lab.environment, **sourced, "ROS_DOMAIN_ID": str(lab.domain)}
        started: dict[tuple[str, str], subprocess.Popen[str]] = {}
        for node in NODES:
            namespace = "/follower_1" if node in KINDS and KINDS[node].robots else "/"
            config = installed / "share" / "robot_formation" / "config" / f"{node}.yaml"
            command = [str(ros2_run(sourced, "robot_formation", node)), "--ros-args", "-r", f"__ns:={namespace}"]
            command += ["--params-file", str(config), *needed.get(node, [])]
            started[node, namespace] = lab.open(command, environment, cwd=tmp_path)
        unseen = set(started)  # so far: no single moment may show all

        def all_seen() -> bool:
            unseen.difference_update(lab.node.get_node_names_and_namespaces())
            return not unseen

        lab.until(all_seen)
        for process in started.values():
            os.killpg(process.pid, signal.SIGINT)
        errors = {node: process.communicate(timeout=60)[1] for (node, _), process in started.items()}
        codes = {node: process.returncode for (node, _), process in started.items()}
    assert codes == dict.fromkeys(NODES, 0), errors
    assert [node for node, text in errors.items() if "Traceback" in text] == []
