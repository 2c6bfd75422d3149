"""How a node begins and ends: help, its first line, complaints, and signals that come late."""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from graph_lab import DEADLINE_S, Lab
from graph_tools import alive
from robot_formation import names
from robot_formation.components.catalogue import KINDS
from robot_formation.nodes.host.ros_parameters import HostParameters
from robot_formation.parameters import specs

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("node_starts")]


def node(name: str, *arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "robot_formation.nodes", name, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False, **options)


@pytest.mark.parametrize("name", sorted(KINDS))
def test_help_tells_purpose_usage_topics_and_every_parameter(name: str) -> None:
    done = node(name, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert f"usage: ros2 run robot_formation {name} --ros-args" in done.stdout
    assert ("-r __ns:=/" in done.stdout) == bool(KINDS[name].robots)
    lines = done.stdout.splitlines()
    assert lines[0].endswith(".")
    for parameter in [*specs(KINDS[name].parameter_class()), *specs(HostParameters)]:
        assert any(line.startswith(f"  {parameter} (") for line in lines), parameter


@pytest.mark.parametrize(
    ("name", "parameter"),
    [
        ("recorder", "regex (string, '')"),
        ("player", "regex (string, '')"),
        ("progress", "followers (integer, 1; 1 to 10)"),
        ("viewer", "rate_hz (double, 20.0 Hz; 0.5 to 60.0 Hz)"),
    ],
)
def test_help_of_the_nodes_for_bags_and_launched_runs(name: str, parameter: str) -> None:
    done = node(name, "-h")
    assert (done.returncode, done.stderr) == (0, "")
    assert "topics and services" in done.stdout
    assert parameter in done.stdout


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("recorder", [], "recorder: say where the bag goes"),
        ("player", [], "player: say which bag is played"),
        ("drive", [], "drive: it belongs to a robot"),
        ("recorder", ["-p", "paht:=x"], "/recorder: no parameter 'paht'; did you mean 'path'?"),
    ],
)
def test_a_complaint_begins_with_the_nodes_name_once(lab: Lab, name: str, arguments: list[str], said: str) -> None:
    process = lab.start(name, *arguments)
    _, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 2
    assert error.startswith(said)
    assert len(error.splitlines()) == 1


def test_a_node_says_when_it_is_ready_and_what_it_waits_for(lab: Lab) -> None:
    process = lab.start("drive", namespace="/leader")
    assert process.stderr is not None
    assert "ready, waiting for move, joint_states" in process.stderr.readline()


@pytest.mark.parametrize(("name", "namespace"), [("drive", "/leader"), ("recorder", "/")])
def test_signals_that_come_while_a_node_ends_do_not_kill_it(
    lab: Lab, tmp_path: Path, name: str, namespace: str
) -> None:
    arguments = ["-p", f"path:={tmp_path / 'bag'}"] if name == "recorder" else []
    process = lab.start(name, *arguments, namespace=namespace)
    assert process.stderr is not None
    assert "ready" in process.stderr.readline()
    numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
    while process.poll() is None:
        for number in numbers:
            if alive(process.pid):
                os.kill(process.pid, number)
        lab.executor.spin_once(0.002)
    assert process.returncode == 0, process.stderr.read()


def test_the_choices_of_a_surface_are_in_its_description(lab: Lab) -> None:
    from rcl_interfaces.srv import DescribeParameters

    lab.start("overhead_tracker")
    client = lab.node.create_client(DescribeParameters, "/overhead_tracker/describe_parameters")
    lab.until(client.service_is_ready)
    future = client.call_async(DescribeParameters.Request(names=["surface"]))
    lab.until(future.done)
    assert "known: bowl, plane" in future.result().descriptors[0].additional_constraints


def test_a_flood_of_bad_messages_is_a_few_lines(lab: Lab) -> None:
    process = lab.start("world")
    commands = lab.publisher(names.joint_commands("leader"))
    health = lab.collect(names.DIAGNOSTICS)
    message = names_message()
    for _ in range(2000):
        commands.publish(message)
    lab.until(lambda: any(int(value) >= 2000 for value in warnings_of(health)))
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0
    assert len([line for line in error.splitlines() if "[WARN]" in line]) <= 20


def names_message() -> Any:
    from sensor_msgs.msg import JointState

    return JointState(name=["nothing"], position=[float("nan")])


def warnings_of(health: Sequence[Any]) -> list[str]:
    return [
        value.value
        for array in health
        for status in array.status
        for value in status.values
        if status.name == "/world" and value.key == "warnings"
    ]
