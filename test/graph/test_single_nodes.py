"""Each node on its own: parameters, signals, and a world and recorder that strangers attach to."""

import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from forked_nodes import ForkedNode
from graph_lab import DEADLINE_S, Lab, values_of
from graph_tools import STRICT
from robot_formation import conversions, names
from robot_formation.bag.reader import read_bag
from robot_formation.components.catalogue import KINDS
from robot_formation.drive.movement_system import WheelCommand
from robot_formation.geometry.se2 import Motion
from robot_formation.launching.environment import node_environment
from robot_formation.network.ros_domain import DomainReservation
from robot_formation.paths import config_dir

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("nodes")]


def alone(name: str, namespace: str, *arguments: str, tmp_path: Path) -> tuple[int, str]:
    """Run a node that must end by itself; returns exit code and its last line."""
    words = ["--ros-args", "-r", f"__ns:={namespace}", *arguments]
    with (
        DomainReservation() as domain,
        ForkedNode(name, words, {**node_environment(domain, tmp_path), **STRICT}) as node,
    ):
        _, errors = node.communicate(timeout=60)
    assert "Traceback" not in errors
    return node.returncode, errors.strip().splitlines()[-1]


@pytest.mark.parametrize(
    ("name", "namespace", "arguments", "words"),
    [
        ("world", "/", ["-p", "surfase:=bowl"], ["'surfase'", "'surface'"]),
        ("world", "/", ["-p", "surface:=bowel"], ["'bowel'", "'bowl'"]),
        ("world", "/", ["--params-file", str(config_dir() / "world.yaml"), "-p", "surface:=bowel"], ["'bowel'"]),
        ("drive", "/leader", ["-p", "max_v_m:=-1.0"], ["max_v_m", "outside"]),
        ("drive", "/leader", ["-p", "max_v_m:=far"], ["max_v_m", "float"]),
        ("leader", "/leader", ["-p", "timesteps:=0"], ["timesteps", "outside"]),
        ("block_detector", "/follower_1", ["-p", "signatures_file:=nowhere.yaml"], ["nowhere.yaml"]),
        ("predictor", "/follower_1", ["-p", "name:=mesured"], ["'mesured'", "'measured'"]),
        ("fine_tuner", "/follower_1", ["-p", "look.frame:=3"], ["'look.frame'", "'look.frames'"]),
        ("overhead_tracker", "/", ["-p", "calibration:=goud"], ["'goud'", "'good'"]),
        ("recorder", "/", [], ["path"]),
        ("recorder", "/", ["--params-file", str(config_dir() / "recorder.yaml")], ["path"]),
        ("recorder", "/", ["-p", "path:=bag", "-p", "regex:='*'"], ["'*'", "no regular expression"]),
        ("recorder", "/", ["-p", "path:=bag", "-p", "metadata:=[seed]"], ["key=value", "'seed'"]),
        ("player", "/", ["--params-file", str(config_dir() / "player.yaml")], ["'bag'"]),
        ("player", "/", ["-p", "bag:=nowhere"], ["nowhere", "doesn't exist"]),
        ("drive", "/", [], ["namespace"]),
        ("fine_tuner", "/somebody", [], ["'somebody'", "follower_1"]),
        ("drive", "/leader", ["--params-file", "missing.yaml"], ["missing.yaml"]),
    ],
)
def test_a_bad_parameter_is_one_line_and_exit_code_2(
    tmp_path: Path, name: str, namespace: str, arguments: list[str], words: list[str]
) -> None:
    code, line = alone(name, namespace, *arguments, tmp_path=tmp_path)
    assert code == 2
    for word in words:
        assert word in line


def ended_or_there(lab: Lab, process: subprocess.Popen[str], node: tuple[str, str]) -> bool:
    return bool(process.poll()) or node in lab.node.get_node_names_and_namespaces()


@pytest.mark.parametrize("name", [*KINDS, "recorder"])
def test_a_node_ends_cleanly_on_signals(lab: Lab, tmp_path: Path, name: str) -> None:
    robots = KINDS[name].robots if name in KINDS else ""
    namespace = {"": "/", "leader": "/leader"}.get(robots, "/follower_1")
    options = ["-p", f"path:={tmp_path / 'bag'}"] if name == "recorder" else ["-p", "wait_for_listeners_s:=600.0"]
    for number in (signal.SIGINT, signal.SIGTERM):
        process = lab.start(name, *options, namespace=namespace)
        lab.until(partial(ended_or_there, lab, process, (name, namespace)))
        process.send_signal(number)
        _, errors = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 0, errors
        assert "Traceback" not in errors
        assert "Warning" not in errors
        if name == "recorder":
            (tmp_path / "bag").rename(tmp_path / f"bag_{number}")
        lab.rejoin()


def test_ctrl_c_while_a_node_still_starts_is_not_lost(tmp_path: Path) -> None:
    early = "import os, signal; from robot_formation.nodes import executables as e; take = e.stop_on_signals"
    code = f"{early}; e.stop_on_signals = lambda: (take(), os.kill(os.getpid(), signal.SIGINT))"
    command = [sys.executable, "-c", f"{code}; raise SystemExit(e.leader())", "--ros-args", "-r", "__ns:=/leader"]
    with DomainReservation() as domain:
        environment = node_environment(domain, tmp_path)
        completed = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert (completed.returncode, completed.stderr) == (0, "")


def test_strangers_drive_a_robot_and_its_camera_in_a_world_of_their_own(lab: Lab, tmp_path: Path) -> None:
    recorder = lab.start("recorder", "-p", f"path:={tmp_path / 'bag'}")
    lab.start("world", "-p", "surface:=plane", "-p", "camera.mode:=on_demand", "-p", "recorder:=recorder")
    joint_states = lab.collect(names.joint_states("leader"), by="drive")
    truths = lab.collect(names.ground_truth_pose("leader"))
    images = lab.collect(names.camera_image("follower_1"), by="block_detector")
    commands = lab.publisher(names.joint_commands("leader"))
    requests = lab.publisher(names.camera_request("follower_1"))
    lab.until(lambda: len(truths) == 1)
    commands.publish(conversions.joint_command(WheelCommand((1.6,) * 4, (4.0,) * 4), 0))
    lab.until(lambda: joint_states and not any(joint_states[-1].velocity))
    lab.until(lambda: len(truths) == 2)
    moved = truths[1].pose.position.y - truths[0].pose.position.y
    assert moved == pytest.approx(0.05, abs=0.01)
    requests.publish(conversions.uint32(3))
    lab.until(lambda: len(images) == 3)
    assert conversions.read_image(images[0]).shape == (208, 316, 3)
    stamps = [conversions.stamp_of(image) for image in images]
    assert stamps == sorted(set(stamps))
    assert stamps[0] > conversions.stamp_of(joint_states[-1])
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=DEADLINE_S)
    with read_bag(tmp_path / "bag") as bag:
        assert len(list(bag.messages(["/leader/joint_states"]))) == len(joint_states)


def test_bad_wheel_commands_move_nothing_and_are_said(lab: Lab) -> None:
    lab.start("world", "-p", "camera.mode:=on_demand", "-p", "wait_for_listeners_s:=0.0")
    joint_states = lab.collect(names.joint_states("leader"))
    health = lab.collect(names.DIAGNOSTICS)
    commands = lab.publisher(names.joint_commands("leader"))
    good = WheelCommand((1.0,) * 4, (4.0,) * 4)
    for bad in (
        conversions.joint_command(WheelCommand((float("nan"),) * 4, (4.0,) * 4), 0),
        conversions.joint_command(WheelCommand((1.0,) * 4, (float("inf"),) * 4), 0),
        conversions.joint_command(WheelCommand((1.0,) * 4, (1e6,) * 4), 0),
    ):
        commands.publish(bad)
    lab.until(lambda: any(value.key == "warnings" and int(value.value) >= 3 for value in values_of(health, "world")))
    assert not any(position for message in joint_states for position in message.position)
    commands.publish(conversions.joint_command(good, 0))
    lab.until(lambda: any(joint_states[-1].position) and not any(joint_states[-1].velocity))


def test_drive_stop_ends_a_move_and_leader_stop_pauses_the_track(lab: Lab) -> None:
    lab.start("world", "-p", "real_time_factor:=1.0", "-p", "wait_for_listeners_s:=0.0", "-p", "camera.mode:=on_demand")
    lab.start("drive", namespace="/leader")
    moved = lab.collect(names.MOVED, namespace="/leader", by="leader")
    joint_states = lab.collect(names.joint_states("leader"))
    moves = lab.publisher(names.MOVE, namespace="/leader")
    # The world waits for nobody here: what it says of the move is lost on whoever has not found it yet.
    lab.until(lambda: lab.node.count_publishers("/leader/joint_states"))
    moves.publish(conversions.move(Motion(x_m=0.2), "leader/base_link", 0))
    lab.until(lambda: joint_states)
    assert lab.call("/leader/drive/stop").success
    lab.until(lambda: moved)
    assert 0.0 < conversions.read_displacement(moved[0]).x_m < 0.15
    assert not lab.call("/leader/drive/stop").success


def test_the_leader_pauses_and_goes_on(lab: Lab) -> None:
    lab.start("leader", "-p", "timesteps:=2", "-p", "wait_for_listeners_s:=600.0", namespace="/leader")
    ticks = lab.collect(names.formation_done("leader"), by="fine_tuner")
    health = lab.collect(names.DIAGNOSTICS)
    moves = lab.collect(names.MOVE, namespace="/leader", by="drive")
    lab.until(lambda: ticks)
    done = lab.publisher(names.formation_done("follower_1"))
    assert lab.call("/leader/stop").success
    done.publish(conversions.uint32(0))
    # Its health says that it waits for nobody any more: the tick has come, and still it stands.
    lab.until(lambda: any(value.key == "waiting for" and not value.value for value in values_of(health, "leader")))
    assert moves == []
    lab.call("/leader/start")
    lab.until(lambda: moves)
    assert conversions.read_move(moves[0]) == Motion(x_m=0.05)
