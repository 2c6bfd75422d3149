"""The `viewer` executable: a run that goes on, in three dimensions in a browser; it listens like any other node."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from robot_formation import conversions, exit_codes, names
from robot_formation.analysis.from_bag import read_ground
from robot_formation.errors import MessageError
from robot_formation.experiment.progress import Progress
from robot_formation.names import Message, Topic
from robot_formation.nodes.followed_run import FollowedRunParameters
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.qos import qos_profile
from robot_formation.nodes.host.ros_parameters import ParameterNode, declare
from robot_formation.nodes.host.signals import stopped
from robot_formation.nodes.progress.monitor import topic_of
from robot_formation.nodes.viewer.world_control import SPEEDS, WorldControl
from robot_formation.parameters import parameter
from robot_formation.viewing.browser import DEFAULT_PORT, address, view_server
from robot_formation.viewing.lens import Lens, read_lens
from robot_formation.viewing.live_moments import LiveMoments
from robot_formation.viewing.moment import TimestepFigures
from robot_formation.viewing.panel import Panel
from robot_formation.viewing.robot_shape import read_shape
from robot_formation.viewing.stage import Stage

# The latest message is enough, and the one who sends it doesn't wait for the viewer to take it.
_LATEST = QoSProfile(
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
)
_PICTURES_HZ = 5.0


@dataclass(frozen=True)
class ViewerParameters(FollowedRunParameters):
    """Whom it shows, and where."""

    timesteps: int = parameter(0, "Timesteps of the run, for texts and plot; 0: not known", low=0, high=1_000_000)
    port: int = parameter(DEFAULT_PORT, "Port on 127.0.0.1 that browsers open; 0: any free one", low=0, high=65535)
    rate_hz: float = parameter(20.0, "How often browsers get what has changed", unit="Hz", low=0.5, high=60.0)


class ViewerExecutable:
    """Serves the page until a signal comes."""

    fixed: ClassVar[Mapping[str, str]] = {"*": "it decides on topics and page; start another one"}

    def __init__(self, node: ParameterNode) -> None:
        (self._parameters,) = declare(node, ViewerParameters, fixed=self.fixed)
        p = self._parameters
        self._node = node
        self._followers = [names.follower(number) for number in range(1, p.followers + 1)]
        self._moments = LiveMoments((names.LEADER, *self._followers), p.places(), delayed=p.delayed)
        self._progress = Progress(
            p.places(),
            p.timesteps,
            lambda text: None,
            lambda: 0.0,
            delayed=p.delayed,
            tell=self._finished,
        )
        self._figures: dict[str, list[TimestepFigures]] = {follower: [] for follower in self._followers}
        self._latest: dict[Topic, bytes] = {}
        self._lenses: dict[str, Lens] = {}
        self._pictured: tuple[str, int] | None = None
        self._warned: set[str] = set()

    def run(self) -> int:
        """Serve; return the exit code.

        Raises:
            ViewError: viser isn't installed, or the port can't be used.
        """
        executor = make_executor()
        executor.add_node(self._node)
        try:
            with view_server(self._parameters.port, "a run that goes on") as server:
                self._build(server)
                self._node.get_logger().info(f"ready, open {address(server.get_port())}")
                self._serve(server, executor.spin_once)
        finally:
            executor.shutdown()
        return exit_codes.DONE

    def _build(self, server: Any) -> None:
        """Make page and subscriptions."""
        p = self._parameters
        self._stage, self._panel = Stage(server), Panel(server, self._followers, p.timesteps or None)
        self._control = WorldControl(self._node)
        self._pause = self._panel.button("pause", self._control.toggle)
        self._panel.button("one step (50 ms)", self._control.step)
        self._panel.choice("speed (times real time)", SPEEDS, SPEEDS[0], self._control.set_speed)
        for topic, take in self._moments.history().items():
            self._subscribe(topic, take)
        for name in self._progress.topics:
            self._subscribe(replace(topic_of(name), name=name.lstrip("/")), partial(self._progress.listen, name))
        self._subscribe(names.SURFACE, self._ground)
        for robot in (names.LEADER, *self._followers):
            self._subscribe(names.robot_description(robot), partial(self._description, robot))
            self._subscribe(names.camera_info(robot), partial(self._lens, robot))
        for topic in [*self._moments.latest(), *self._moments.pictures()]:
            kind = conversions.message_class(topic.type)
            # As it came: most messages are replaced before anybody looks at them.
            self._node.create_subscription(
                kind, topic.name, partial(self._latest.__setitem__, topic), _LATEST, raw=True
            )

    def _subscribe(self, topic: Topic, take: Callable[[Message], None]) -> None:
        kind = conversions.message_class(topic.type)
        self._node.create_subscription(kind, topic.name, take, qos_profile(topic.qos))

    def _serve(self, server: Any, spin_once: Callable[[float], None]) -> None:
        period_s = 1.0 / self._parameters.rate_hz
        due = pictures_due = time.monotonic()
        while not stopped():
            spin_once(max(0.0, due - time.monotonic()))
            now = time.monotonic()
            if now < due:
                continue
            due = now + period_s
            self._panel.act()
            if server.get_clients():
                self._show()
                if now >= pictures_due:
                    pictures_due = now + 1.0 / _PICTURES_HZ
                    self._show_picture()

    def _show(self) -> None:
        self._decode(self._moments.latest())
        moment = self._moments.at_present()
        for robot, path in self._moments.paths.items():
            self._stage.path(robot, path)
        self._moments.paths.clear()
        self._stage.show(moment)
        follower = self._panel.follower
        figures = self._figures[follower]
        self._panel.tell(moment, self._parameters.timesteps or None, self._control.remark, figures)
        label = "go on" if self._control.paused else "pause"
        if self._pause.label != label:
            self._pause.label = label

    def _show_picture(self) -> None:
        self._decode(self._moments.pictures())
        follower = self._panel.follower
        found = self._moments.picture(follower)
        if found is not None and self._pictured != (follower, found[0]):
            self._pictured = (follower, found[0])
            self._panel.picture(found[1])
            self._stage.picture(follower, found[1])

    def _decode(self, handlers: Mapping[Topic, Callable[[Message], None]]) -> None:
        for topic, take in handlers.items():
            cdr = self._latest.pop(topic, None)
            if cdr is not None:
                try:
                    take(conversions.from_cdr(cdr, topic.type))
                except MessageError as error:
                    self._warn(f"{topic.name}: {error}")

    def _warn(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._node.get_logger().warning(text)

    def _ground(self, message: Message) -> None:
        ground = read_ground(message)
        if ground is not None:
            self._stage.ground(ground)

    def _description(self, robot: str, message: Message) -> None:
        self._stage.robot(robot, read_shape(message.data))
        self._cone(robot)

    def _lens(self, robot: str, message: Message) -> None:
        lens = read_lens(message)
        if lens is not None:
            self._lenses[robot] = lens
            self._cone(robot)

    def _cone(self, robot: str) -> None:
        with contextlib.suppress(KeyError):  # description and lens come in any order
            self._stage.camera(robot, self._lenses[robot])

    def _finished(self, robot: str, timestep: int, correction_m: float, error_m: float) -> None:
        self._figures[robot].append(TimestepFigures(timestep, correction_m, error_m))
