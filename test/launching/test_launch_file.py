"""`ros2 launch` with the real launch, where it is installed; launching/test_process_table.py needs none."""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from graph_lab import Lab
from graph_tools import alive
from repository import ROOT
from robot_formation.analysis.from_bag import load_run
from robot_formation.experiment.scenario import load_track
from robot_formation.launching.processes import processes
from robot_formation.paths import share_dir

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("launch_file")]
DEADLINE_S = 120.0
PROGRESS = 1  # the node beside those of the run


def is_installed() -> bool:
    """Whether `ros2 launch` can find this package."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    marker = Path("share", "ament_index", "resource_index", "packages", "robot_formation")
    return shutil.which("ros2") is not None and any((Path(prefix) / marker).is_file() for prefix in prefixes)


needs_ros2 = pytest.mark.skipif(not is_installed(), reason="needs ros2 launch and this package built by colcon")
needs_launch_testing = pytest.mark.skipif(
    not is_installed() or importlib.util.find_spec("launch_testing") is None, reason="needs launch_testing"
)


def start(lab: Lab, *arguments: str) -> subprocess.Popen[str]:
    return lab.open(["ros2", "launch", "robot_formation", "formation.launch.py", *arguments], lab.environment)


def children(pid: int) -> list[int]:
    """Process ids of a process's children."""
    return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def ended_cleanly(output: str) -> int:
    """How many processes launch says have ended well, if it has not had to say anything else of one."""
    assert "process has died" not in output, output
    assert "escalating" not in output, output
    return output.count("process has finished cleanly")


@needs_ros2
def test_a_launched_run_ends_by_itself_and_leaves_its_bag(lab: Lab, tmp_path: Path) -> None:
    arguments = ("seed:=3", "camera:=on_demand", "set:=leader.timesteps=2", f"bag:={tmp_path / 'bag'}")
    output = "".join(start(lab, *arguments).communicate(timeout=DEADLINE_S))
    assert ended_cleanly(output) == len(processes(load_track("two"), tmp_path)) + PROGRESS
    assert output.count("timestep ") == 2
    assert f"outcome: done, bag {tmp_path / 'bag'}" in output
    assert "was required" not in output
    assert len(load_run(tmp_path / "bag").followers[0].displacements) == 2


@needs_ros2
def test_ctrl_c_ends_launch_and_every_node(lab: Lab) -> None:
    nodes = {(process.executable, process.namespace) for process in processes(load_track("one"), None)}
    process = start(lab, "track:=one", "real_time_factor:=0.1")
    lab.until(lambda: nodes <= set(lab.node.get_node_names_and_namespaces()))
    os.killpg(process.pid, signal.SIGINT)
    output = "".join(process.communicate(timeout=DEADLINE_S))
    assert ended_cleanly(output) == len(nodes) + PROGRESS


@needs_ros2
def test_a_misspelt_track_is_said(lab: Lab) -> None:
    output = "".join(start(lab, "track:=tow").communicate(timeout=DEADLINE_S))
    assert "did you mean 'two'" in output


@needs_ros2
@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("bag:={folder}", "exists already"),
        ("rviz:=true", "needs the package rviz2"),
        ("images:=maybe", "'true', 'false'"),
    ],
)
def test_what_cannot_go_well_is_said_before_any_node_starts(lab: Lab, tmp_path: Path, argument: str, says: str) -> None:
    if "rviz" in argument and shutil.which("rviz2"):
        pytest.skip("this machine has rviz2")
    process = start(lab, argument.format(folder=tmp_path))
    output = "".join(process.communicate(timeout=DEADLINE_S))
    assert process.returncode == 1
    assert says in output
    assert "process started" not in output


@needs_ros2
def test_launch_fails_when_a_node_dies_and_nothing_is_left(lab: Lab, tmp_path: Path) -> None:
    process = start(lab, "seed:=3", "real_time_factor:=0.1", f"bag:={tmp_path / 'bag'}")
    nodes = {(each.executable, each.namespace) for each in processes(load_track("two"), tmp_path)}
    lab.until(lambda: nodes <= set(lab.node.get_node_names_and_namespaces()))
    (victim,) = [pid for pid in children(process.pid) if b"predictor" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    started = children(process.pid)
    os.kill(victim, signal.SIGKILL)
    output = "".join(process.communicate(timeout=DEADLINE_S))
    assert process.returncode == 1
    assert "outcome: incomplete (follower_1/predictor was killed by SIGKILL)" in output
    assert not [pid for pid in started if alive(pid)]
    assert (tmp_path / "bag").is_dir()


TWO_SITES = """
from launch import LaunchDescription
from launch.actions import GroupAction, IncludeLaunchDescription, LogInfo
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EnvironmentVariable
from launch_ros.actions import PushRosNamespace

ARGUMENTS = {{"seed": "3", "camera": "on_demand", "set": "leader.timesteps=2"}}


def site(name, **more):
    arguments = {{**ARGUMENTS, "bag": f"{folder}/{{name}}", **more}}.items()
    run = IncludeLaunchDescription(PythonLaunchDescriptionSource("{file}"), launch_arguments=arguments)
    return GroupAction([PushRosNamespace(name), run])


def generate_launch_description():
    found = EnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", default_value="unset")
    later = LogInfo(msg=["range afterwards: ", found])
    return LaunchDescription([site("site_a"), site("site_b", namespace="deep"), later])
"""


@needs_ros2
def test_two_formations_below_pushed_namespaces_end_well_and_give_the_same_run(lab: Lab, tmp_path: Path) -> None:
    file = tmp_path / "two.launch.py"
    file.write_text(TWO_SITES.format(folder=tmp_path, file=share_dir() / "launch" / "formation.launch.py"))
    environment = {name: text for name, text in lab.environment.items() if name != "ROS_AUTOMATIC_DISCOVERY_RANGE"}
    process = lab.open(["ros2", "launch", str(file)], environment)
    output = "".join(process.communicate(timeout=3 * DEADLINE_S))
    assert process.returncode == 0, output
    assert output.count("outcome: done") == 2
    assert "range afterwards: unset" in output
    one, other = (load_run(tmp_path / name).followers[0].displacements for name in ("site_a", "site_b"))
    assert one == other
    assert len(one) == 2


@needs_launch_testing
def test_the_launch_test_passes(lab: Lab) -> None:
    file = ROOT / "test" / "helpers" / "launch_formation.py"
    process = lab.open([sys.executable, "-m", "launch_testing.launch_test", str(file)], lab.environment)
    output = "".join(process.communicate(timeout=DEADLINE_S))
    assert process.returncode == 0, output
