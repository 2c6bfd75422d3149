"""colcon builds the package as users of a ROS workspace do."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

# On one core when the suite is spread: one build serves all.
pytestmark = pytest.mark.xdist_group("colcon")

ROOT = Path(__file__).parent.parent
# The folder of the environment's executables; not resolved, since python itself may be a link to somewhere else.
BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The install folder of a colcon build of this source."""
    colcon = shutil.which("colcon", path=f"{BIN}{os.pathsep}{os.environ.get('PATH', '')}")
    if colcon is None:
        pytest.skip("colcon is not installed: pip install colcon-common-extensions")
    listed = subprocess.run(["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, capture_output=True)
    if listed.returncode != 0:
        pytest.skip("not a git checkout: which files are source is not known")
    workspace = tmp_path_factory.mktemp("workspace")
    for name in filter(None, listed.stdout.decode().split("\0")):
        if (ROOT / name).is_file():  # a removed file may still be in the index
            target = workspace / "src" / "robot_formation" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "COLCON_HOME": str(workspace)}
    command = [colcon, "--log-base", str(workspace / "log"), "build"]
    result = subprocess.run(command, cwd=workspace, env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return workspace / "install" / "robot_formation"


def test_each_node_and_the_command_become_executables(installed):
    nodes = {"world", "drive", "leader", "block_detector", "predictor", "fine_tuner", "recorder", "player"}
    folder = installed / "lib" / "robot_formation"
    assert nodes | {"formation"} <= {file.name for file in folder.iterdir()}
    assert all(os.access(file, os.X_OK) for file in folder.iterdir())


def test_config_launch_and_the_index_marker_are_installed(installed):
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


def test_the_installed_command_starts_and_finds_what_was_installed_with_it(installed, tmp_path):
    (site_packages,) = installed.glob("lib/python3*/site-packages")
    environment = {
        **os.environ,
        "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(site_packages),
    }
    command = [str(installed / "lib" / "robot_formation" / "formation"), "doctor", "--json"]
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert str(installed / "share" / "robot_formation" / "config") in result.stdout
