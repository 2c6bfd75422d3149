"""A follower without the world: stand-ins for wheels and Pixy2 that keep the promises of docs/how-to/real_robots.md."""

import math
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rclpy.node import Node

from graph_lab import Lab
from repository import ROOT
from robot_formation import conversions, names
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.names import JOINTS, Topic
from robot_formation.nodes.host.qos import qos_profile

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("real_robots")]

PAGE = ROOT / "docs" / "how-to" / "real_robots.md"
ROBOT = "/follower_1"
# The camera's library, with the Target face where it belongs in formation.
PIXY = """
from types import SimpleNamespace

VALUES = {"signature": 1, "x": 158, "y": 52, "width": 48, "height": 48, "angle": 0, "index": 3, "age": 90}

def init(): pass
def change_prog(name): assert name == "color_connected_components"
def BlockArray(count): return [None] * count
def ccc_get_blocks(most, found):
    found[0] = SimpleNamespace(**{f"m_{name}": value for name, value in VALUES.items()})
    return 1
"""


class Bridge:
    """A motor controller: turns the wheels at once, reports on the way and at rest, and echoes the command's number."""

    def __init__(self, lab: Lab) -> None:
        self.node = Node("world", namespace=ROBOT, context=lab.context)
        lab.executor.add_node(self.node)
        self.positions = dict.fromkeys(JOINTS, 7.0)  # since power-up
        self.numbers: list[str] = []
        self._publisher = self._make(self.node.create_publisher, names.joint_states())
        self._make(self.node.create_subscription, names.joint_commands(), self._turn)
        self._make(self.node.create_subscription, names.camera_request(), lambda message: None)  # the camera streams
        lab.until(lambda: self._publisher.get_subscription_count() == 1)
        self._report("", 0.0)

    def _make(self, make: Callable[..., Any], topic: Topic, *callback: Callable[[Any], None]) -> Any:
        return make(conversions.message_class(topic.type), topic.name, *callback, qos_profile(topic.qos))

    def _turn(self, message: Any) -> None:
        number = message.header.frame_id
        self.numbers.append(number)
        self._report(number, 1.0)
        for name, angle in zip(message.name, message.position, strict=True):
            self.positions[name] += angle
        p = DriveParameters()
        forward = message.position[0] if message.position[0] == message.position[3] == message.position[1] else 0.0
        distance = math.copysign((abs(forward) - p.calibration.v[0]) / p.calibration.v[1], forward) if forward else 0.0
        self.positions["encoder_wheel_v"] += distance / p.encoder_radius_m
        self._report(number, 0.0)

    def _report(self, number: str, speed: float) -> None:
        values = list(self.positions.values())
        message = conversions.joint_states(JOINTS, values, [speed] * len(JOINTS), time.time_ns(), number)
        self._publisher.publish(message)


def start_camera(lab: Lab, folder: Path) -> subprocess.Popen[str]:
    """The page's own driver, with a camera that is always asked in formation."""
    code = re.findall(r"<!-- pixy2 -->\n```python\n(.*?)```", PAGE.read_text(), re.DOTALL)[0]
    (folder / "driver.py").write_text(code)
    (folder / "pixy.py").write_text(PIXY)
    command = [sys.executable, str(folder / "driver.py"), "--ros-args", "-r", f"__ns:={ROBOT}"]
    path = f"{folder}:{ROOT}"
    return lab.open(command, {**lab.environment, "PYTHONPATH": path, "PYTHONSAFEPATH": ""})


def test_a_follower_drives_a_timestep_with_a_pixy2_and_a_motor_controller(lab: Lab, tmp_path: Path) -> None:
    camera = start_camera(lab, tmp_path)
    for node in ("drive", "predictor", "fine_tuner"):
        lab.start(node, "-p", "wait_for_listeners_s:=60.0", namespace=ROBOT)
    bridge = Bridge(lab)
    own_ticks = lab.collect(names.formation_done("follower_1"))
    reader = Node("leader", namespace="/leader", context=lab.context)  # whom the fine-tuner's first tick waits for
    lab.executor.add_node(reader)
    tick = names.formation_done("leader")
    kind = conversions.message_class(tick.type)
    reader.create_subscription(
        kind, names.formation_done("follower_1").name, lambda message: None, qos_profile(tick.qos)
    )
    displacements = lab.collect(names.DISPLACEMENT, namespace=ROBOT)
    ticks = lab.publisher(tick)
    ticks.publish(conversions.uint32(0))
    lab.until(lambda: [message.data for message in own_ticks] == [0])
    ticks.publish(conversions.uint32(1))
    lab.until(lambda: [message.data for message in own_ticks] == [0, 1])
    lab.until(lambda: displacements)
    driven = conversions.read_displacement(displacements[0])
    assert (driven.x_m, driven.y_m) == pytest.approx((0.05, 0.0), abs=1e-9)
    assert bridge.numbers == ["1"]
    assert camera.poll() is None
    reader.destroy_node()
    bridge.node.destroy_node()
