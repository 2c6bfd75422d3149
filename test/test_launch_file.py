"""`ros2 launch` with the real launch, where it is installed; test_launching_table.py needs none."""

import importlib.util
import os
import shutil
import signal
import sys
from pathlib import Path

import pytest

from robot_formation.analysis.from_bag import load_run
from robot_formation.experiment.scenario import load_track
from robot_formation.launching.processes import processes

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("graph")]
DEADLINE_S = 120.0


def is_installed():
    """Whether `ros2 launch` can find this package."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    marker = Path("share", "ament_index", "resource_index", "packages", "robot_formation")
    return shutil.which("ros2") is not None and any((Path(prefix) / marker).is_file() for prefix in prefixes)


needs_ros2 = pytest.mark.skipif(not is_installed(), reason="needs ros2 launch and this package built by colcon")
needs_launch_testing = pytest.mark.skipif(
    not is_installed() or importlib.util.find_spec("launch_testing") is None, reason="needs launch_testing"
)


def start(lab, *arguments):
    return lab.open(["ros2", "launch", "robot_formation", "formation.launch.py", *arguments], lab.environment)


def ended_cleanly(output):
    """How many processes launch says have ended well, if it has not had to say anything else of one."""
    assert "process has died" not in output, output
    assert "escalating" not in output, output
    return output.count("process has finished cleanly")


@needs_ros2
def test_a_launched_run_ends_by_itself_and_leaves_its_bag(lab, tmp_path):
    arguments = ("seed:=3", "camera:=on_demand", "set:=leader.timesteps=2", f"bag:={tmp_path / 'bag'}")
    output = "".join(start(lab, *arguments).communicate(timeout=DEADLINE_S))
    assert ended_cleanly(output) == len(processes(load_track("two"), tmp_path))
    assert len(load_run(tmp_path / "bag").followers[0].displacements) == 2


@needs_ros2
def test_ctrl_c_ends_launch_and_every_node(lab):
    nodes = {(process.executable, process.namespace) for process in processes(load_track("one"), None)}
    process = start(lab, "track:=one", "real_time_factor:=0.1")
    lab.until(lambda: nodes <= set(lab.node.get_node_names_and_namespaces()))
    os.killpg(process.pid, signal.SIGINT)
    output = "".join(process.communicate(timeout=DEADLINE_S))
    assert ended_cleanly(output) == len(nodes)


@needs_ros2
def test_a_misspelt_track_is_said(lab):
    output = "".join(start(lab, "track:=tow").communicate(timeout=DEADLINE_S))
    assert "did you mean 'two'" in output


@needs_launch_testing
def test_the_launch_test_passes(lab):
    file = Path(__file__).with_name("launch_formation.py")
    process = lab.open([sys.executable, "-m", "launch_testing.launch_test", str(file)], lab.environment)
    output = "".join(process.communicate(timeout=DEADLINE_S))
    assert process.returncode == 0, output
