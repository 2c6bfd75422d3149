"""A run made up of known displacements and errors, written as a bag; messages are serialised by rosbags."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.writer import BagWriter

STORE = get_typestore(Stores.ROS2_JAZZY)
T: dict[str, Any] = dict(STORE.types)
SECOND = 10**9
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"


def header(stamp_ns: int, frame: str = "base_link") -> Any:
    sec, nanosec = divmod(stamp_ns, SECOND)
    return T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](sec, nanosec), frame)


def pose(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Any:
    point = T["geometry_msgs/msg/Point"](x, y, z)
    return T["geometry_msgs/msg/Pose"](
        point, T["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    )


def pose_with_covariance(stamp_ns: int, x: float, y: float, yaw: float = 0.0) -> Any:
    with_covariance = T["geometry_msgs/msg/PoseWithCovariance"](pose(x, y, yaw), np.zeros(36))
    return T[POSE_COVARIANCE](header(stamp_ns), with_covariance)


def odometry(stamp_ns: int, x: float, y: float, yaw: float, z: float = 0.0) -> Any:
    zero = T["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = T["geometry_msgs/msg/TwistWithCovariance"](T["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36))
    with_covariance = T["geometry_msgs/msg/PoseWithCovariance"](pose(x, y, yaw, z), np.zeros(36))
    return T["nav_msgs/msg/Odometry"](header(stamp_ns, "world"), "base_link", with_covariance, twist)


def text(words: str) -> Any:
    return T["std_msgs/msg/String"](words)


def bowl_height(x: float, y: float) -> float:
    return 0.05 + ((x - 0.89) ** 2 + (y - 0.89) ** 2) / 10.0


def surface_marker(cells: int = 24, size: float = 1.78) -> Any:
    grid = np.linspace(0.0, size, cells + 1)
    points = []
    for i in range(cells):
        for j in range(cells):
            a, b, c, d = ((grid[i + p], grid[j + q]) for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
            points += [T["geometry_msgs/msg/Point"](x, y, bowl_height(x, y)) for x, y in (a, b, c, a, c, d)]
    no_bytes = np.array([], dtype=np.uint8)
    return T["visualization_msgs/msg/Marker"](
        header=header(0, "world"),
        ns="surface",
        id=0,
        type=11,
        action=0,
        pose=pose(0.0, 0.0),
        scale=T["geometry_msgs/msg/Vector3"](1.0, 1.0, 1.0),
        color=T["std_msgs/msg/ColorRGBA"](0.5, 0.5, 0.5, 1.0),
        lifetime=T["builtin_interfaces/msg/Duration"](0, 0),
        frame_locked=False,
        points=points,
        colors=[],
        texture_resource="",
        texture=T["sensor_msgs/msg/CompressedImage"](header(0, ""), "", no_bytes),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=T["visualization_msgs/msg/MeshFile"]("", no_bytes),
        mesh_use_embedded_materials=False,
    )


@dataclass
class Step:
    """A timestep's truth; vectors are (u, v) in metres, `error` is actual minus desired in the leader's frame."""

    moved: tuple[float, float] = (0.001, 0.05)
    corrections: list[tuple[float, float]] = field(default_factory=list)
    turns: list[float] = field(default_factory=list)
    residual: tuple[float, float] = (0.0, 0.0)
    prediction: tuple[float, float] | None = None
    error: tuple[float, float] = (0.0, 0.0)
    heading_error: float = 0.0
    finished: bool = True


class SyntheticRun:
    """Writes a run timestep by timestep; simulated time goes on by a second per event."""

    def __init__(
        self,
        writer: BagWriter,
        followers: int = 1,
        leader: tuple[float, float, float] = (1.412, 0.111, 0.75 * math.pi),
        surface: bool = True,
    ) -> None:
        self.writer = writer
        self.now = 0
        self.leader = leader
        self.followers = [f"follower_{n}" for n in range(1, followers + 1)]
        for robot in ["leader", *self.followers]:
            for topic in ("moved", "displacement", "residual", "prediction"):
                self.topic(f"/{robot}/{topic}", POSE_COVARIANCE)
            self.topic(f"/{robot}/alignment", "std_msgs/msg/String")
            self.topic(f"/ground_truth/{robot}/odom", "nav_msgs/msg/Odometry")
        self.topic("/surface", "visualization_msgs/msg/Marker")
        if surface:
            self.send("/surface", surface_marker())
        self.odom("leader", *leader)
        for number, robot in enumerate(self.followers, 1):
            self.place(robot, (0.0, 0.0), number * 0.32, 0.0)
            self.alignment_move(robot)

    def topic(self, name: str, type_name: str) -> None:
        self.writer.add_topic(name, type_name, TopicQos(history="keep_all", depth=0))

    def send(
        self,
        topic: str,
        message: Any,
    ) -> None:
        self.writer.write(topic, bytes(STORE.serialize_cdr(message, message.__msgtype__)), self.now)

    def tick(self) -> None:
        self.now += SECOND

    def odom(self, robot: str, x: float, y: float, yaw: float) -> None:
        self.send(f"/ground_truth/{robot}/odom", odometry(self.now, x, y, yaw, bowl_height(x, y)))

    def moved(self, robot: str, u: float, v: float, yaw: float = 0.0) -> None:
        self.tick()
        self.send(f"/{robot}/moved", pose_with_covariance(self.now, v, -u, yaw))

    def alignment_move(self, robot: str) -> None:
        """A move of timestep 0, which belongs to no timestep."""
        self.moved(robot, 0.5, 0.5)

    def place(self, robot: str, error: tuple[float, float], right: float, heading_error: float) -> None:
        x, y, yaw = self.leader
        forward, left = error[1], -error[0] - right
        c, s = math.cos(yaw), math.sin(yaw)
        self.odom(robot, x + c * forward - s * left, y + s * forward + c * left, yaw + heading_error)

    def step(self, step: Step) -> None:
        self.leader_moves()
        for number, robot in enumerate(self.followers, 1):
            self.send(f"/{robot}/alignment", text("predict"))
            self.moved(robot, *step.moved)
            for correction in step.corrections:
                self.send(f"/{robot}/alignment", text("correct: v"))
                self.moved(robot, *correction)
            for turn in step.turns:
                self.moved(robot, 0.0, 0.0, turn)
            self.tick()
            self.place(robot, step.error, number * 0.32, step.heading_error)
            if step.finished:
                self.finish(robot, step)

    def leader_moves(self) -> None:
        x, y, yaw = self.leader
        self.leader = (x + 0.05 * math.cos(yaw), y + 0.05 * math.sin(yaw), yaw)
        self.moved("leader", 0.0, 0.05)
        self.odom("leader", *self.leader)

    def finish(self, robot: str, step: Step) -> None:
        u, v = step.moved
        self.send(f"/{robot}/displacement", pose_with_covariance(self.now, v, -u))
        self.send(f"/{robot}/residual", pose_with_covariance(self.now, step.residual[1], -step.residual[0]))
        if step.prediction is not None:
            self.send(f"/{robot}/prediction", pose_with_covariance(self.now, step.prediction[1], -step.prediction[0]))
        self.send(f"/{robot}/alignment", text("aligned"))

    def lose(self, robot: str) -> None:
        self.tick()
        self.send(f"/{robot}/alignment", text("lost"))


STEPS = [
    Step(moved=(0.010, 0.050), corrections=[(0.02, 0.0)], prediction=(0.011, 0.051), error=(0.01, 0.0)),
    Step(moved=(0.020, 0.049), prediction=(0.021, 0.052), error=(-0.01, 0.0)),
    Step(moved=(0.030, 0.048), corrections=[(0.5, 0.5)], prediction=(0.031, 0.053), error=(0.01, 0.0)),
    Step(
        moved=(0.040, 0.047),
        corrections=[(-0.01, 0.002), (0.001, -0.03)],
        turns=[0.1, -0.2],
        residual=(0.004, -0.005),
        prediction=(-0.032, 0.054),
        error=(0.03, 0.04),
        heading_error=-0.3,
    ),
    Step(moved=(-0.050, 0.046), corrections=[(0.0, 0.02)], prediction=(0.033, 0.055), error=(0.01, -0.02)),
]


def write_run(
    path: Path,
    steps: Sequence[Step],
    *,
    followers: int = 1,
    details: dict[str, str] | None = None,
    lost: Sequence[str] | tuple[()] = (),
    surface: bool = True,
    missing: tuple[()] = (),
) -> Path:
    with BagWriter(path) as writer:
        if details is not None:
            writer.write_metadata(METADATA_NAME, details)
        run = SyntheticRun(writer, followers, surface=surface)
        for step in steps:
            run.step(step)
        for robot in lost:
            run.lose(robot)
    return path
