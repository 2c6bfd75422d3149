"""The `player` executable: publishes the messages of a bag, raw, when they are due."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_srvs.srv import SetBool, Trigger

from robot_formation import conversions, exit_codes, names
from robot_formation.bag.errors import BagError
from robot_formation.bag.metadata import TopicSummary
from robot_formation.bag.playback import Excerpt, Playhead, Prefetch, ScheduleErrors, make_excerpt
from robot_formation.bag.reader import Bag, read_bag
from robot_formation.bag.selection import Selection
from robot_formation.bag.source import RawMessage
from robot_formation.names import Message
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.qos import qos_profile
from robot_formation.nodes.host.ros_parameters import ParameterNode, declare, take_changes
from robot_formation.nodes.host.signals import stopped
from robot_formation.nodes.player.keyboard import Keyboard
from robot_formation.nodes.player.republisher import Republisher
from robot_formation.parameters import ParameterError, parameter, specs

_POLL_S = 0.02  # how often keys, services and signals are looked at
_LAST_S = 2.0


@dataclass(frozen=True)
class PlayerParameters:
    """Which bag is played, and how."""

    bag: str = parameter("", "Bag to play: a folder, an .mcap or a .db3 file")
    rate: float = parameter(1.0, "Bag seconds per second", low=1e-3, high=1e3)
    start_s: float = parameter(0.0, "Where to begin, from the bag's first message on", unit="s", low=0.0, high=1e9)
    duration_s: float = parameter(0.0, "How much to play; 0: to the bag's end", unit="s", low=0.0, high=1e9)
    loop: bool = parameter(False, "Begin again at the end")
    topics: tuple[str, ...] = parameter((), "Topics to play; with an empty 'regex' too, all are played")
    regex: str = parameter("", "Regular expression of topics to play, matched as a whole")
    exclude: str = parameter(
        "", "Regular expression of topics that are left out unless 'topics' names them, matched as a whole"
    )
    remap: tuple[str, ...] = parameter((), "Other names for topics of the bag: texts 'FROM:=TO'")
    clock_hz: float = parameter(
        0.0, "Rate at which bag time is published on /clock, instead of the bag's own; 0: not", unit="Hz", low=0.0,
        high=1e4,
    )  # fmt: skip
    wait_s: float = parameter(
        2.0, "How long to wait at most until every topic has a subscriber", unit="s", low=0.0, high=1e6
    )
    paused: bool = parameter(False, "Begin in a pause")

    def remaps(self) -> dict[str, str]:
        """Split the remappings.

        Raises:
            ParameterError: a text is none.
        """
        found = {}
        for text in self.remap:
            source, sign, target = text.partition(":=")
            if not (sign and source.startswith("/") and target):
                raise ParameterError(f"'remap' takes texts like /from:=/to, not '{text}'")
            found[source] = target
        return found


@dataclass(frozen=True)
class PlayReport:
    """What was played.

    Attributes:
        messages: messages published, by topic of the bag.
        rounds: times that the bag was played to its end.
        seconds: wall time from the first message on, pauses included.
        schedule: size of the schedule error in milliseconds (median_ms, p99_ms, worst_ms); None without messages.
        skipped: topics that could not be played, and why.
        unheard: topics that nobody had subscribed to when the waiting ended.
        interrupted: whether a signal has stopped it.
    """

    messages: Mapping[str, int]
    rounds: int
    seconds: float
    schedule: Mapping[str, float] | None
    skipped: Mapping[str, str]
    unheard: tuple[str, ...]
    interrupted: bool


class PlayerNode:
    """Publishes a part of a bag on a schedule.

    Args:
        node: joins the graph; its remappings count.
        bag: the open bag.
        parameters: what is played, and how.
        warn: told what is not played; by default the node's log.
    """

    fixed: ClassVar[Mapping[str, str]] = dict.fromkeys(
        sorted(specs(PlayerParameters).keys() - {"rate", "loop"}), "the playback was prepared with it"
    )
    """Parameters that can't be set while it plays, and why."""

    def __init__(
        self, node: Node, bag: Bag, parameters: PlayerParameters, warn: Callable[[str], None] | None = None
    ) -> None:
        self._node, self._bag, self._parameters = node, bag, parameters
        self._warn: Callable[[str], None] = warn or (lambda text: node.get_logger().warning(text))
        self._skipped: dict[str, str] = {}
        self._outputs: dict[str, Republisher] = {}
        self._errors = ScheduleErrors()
        self._head = Playhead(parameters.rate, bag.start_ns, time.monotonic())
        self._keyboard = Keyboard()
        self._steps = 0
        self._rounds = 0
        self._quit = False
        self._stop: Callable[[], bool] = stopped
        self._polled_s = self._clock_s = 0.0
        self._excerpt = self._prepare()
        node.create_service(SetBool, "~/pause", self._on_pause)
        node.create_service(Trigger, "~/step", self._on_step)
        self._clock = self._make_clock() if parameters.clock_hz > 0.0 else None
        self._executor: Executor = make_executor(node.context)
        self._executor.add_node(node)

    def _make_clock(self) -> Publisher:
        topic = names.ROS_CLOCK
        return self._node.create_publisher(conversions.message_class(topic.type), topic.name, qos_profile(topic.qos))

    def _prepare(self) -> Excerpt:
        """Choose the topics and make their publishers."""
        p = self._parameters
        selection = Selection(p.topics, p.regex, p.exclude)
        contents = {topic.name: topic for topic in self._bag.contents if topic.message_count}
        selection.check(contents, self._bag.path)
        remaps = p.remaps()
        Selection(tuple(remaps)).check(contents, self._bag.path)
        for name, topic in contents.items():
            if not selection.wants(name, topic.type_name):
                continue
            if p.clock_hz > 0.0 and name == names.ROS_CLOCK.name:
                continue
            self._open(topic, remaps.get(name, name))
        if not self._outputs:
            raise BagError(f"{self._bag.path} has no message to play on the topics that are asked for")
        latched = {name: output.depth for name, output in self._outputs.items() if output.latched}
        return make_excerpt(self._bag, frozenset(self._outputs), latched, p.start_s, p.duration_s)

    def _open(self, topic: TopicSummary, name: str) -> None:
        try:
            message_class = conversions.message_class(topic.type_name)
        except (ImportError, AttributeError, ValueError):
            self._skipped[topic.name] = f"its type {topic.type_name} is not installed"
            self._warn(f"{topic.name} is not played: {self._skipped[topic.name]}")
            return
        try:
            self._outputs[topic.name] = Republisher(self._node, name, message_class, topic.profiles)
        except InvalidTopicNameException:
            raise BagError(f"'{name}' is no name for a topic; give one like /follower_1/moved") from None

    def run(self, stop: Callable[[], bool] = stopped) -> PlayReport:
        """Play until the end, or until `stop` or a key says so.

        Raises:
            BagError: the bag is corrupted, or a subscriber takes no more messages.
        """
        self._stop = stop
        # What was made so far lives on; collecting it again and again would hold up messages.
        gc.collect()
        gc.freeze()
        began = time.monotonic()
        try:
            with self._keyboard:
                unheard = self._wait_for_subscribers()
                began = time.monotonic()
                self._head.jump(self._excerpt.start_ns, began)
                self._head.pause(self._parameters.paused, began)
                while not self._ended and (self._rounds == 0 or self._parameters.loop):
                    self._play()
            self._deliver()
            return self._report(time.monotonic() - began, unheard)
        finally:
            gc.unfreeze()
            self._executor.shutdown()

    def set_parameters(self, parameters: PlayerParameters) -> None:
        """Set another rate, and whether to begin again at the end."""
        self._head.set_rate(parameters.rate, time.monotonic())
        self._parameters = parameters

    @property
    def _ended(self) -> bool:
        return self._quit or self._stop()

    def _report(self, seconds: float, unheard: tuple[str, ...]) -> PlayReport:
        sent = {name: output.sent for name, output in self._outputs.items()}
        return PlayReport(
            sent, self._rounds, seconds, self._errors.summary_ms(), self._skipped, unheard, interrupted=self._stop()
        )

    def _deliver(self) -> None:
        """Wait until the subscribers have everything; those that are gone never say so."""
        end = time.monotonic() + _LAST_S
        for output in self._outputs.values():
            if not self._stop():
                output.deliver(max(0.0, end - time.monotonic()))

    def _wait_for_subscribers(self) -> tuple[str, ...]:
        """Wait until every topic has one; return the topics that have none when the time is up."""
        end = time.monotonic() + self._parameters.wait_s
        while True:
            unheard = [name for name, output in self._outputs.items() if not output.subscribers]
            if not unheard or time.monotonic() > end or self._ended:
                return tuple(unheard)
            self._executor.spin_once(_POLL_S)

    def _play(self) -> None:
        """Play the excerpt once."""
        self._poll(time.monotonic())
        for message in self._excerpt.first(self._bag):
            self._send(message)
        with Prefetch(self._excerpt.scheduled(self._bag)) as source:
            found = source.next()
            # The schedule begins when the bag's first messages have been read.
            self._head.jump(self._excerpt.start_ns, time.monotonic())
            while found is not None and self._wait_until_due(found):
                self._send(found)
                found = source.next()
        self._rounds += 0 if self._ended else 1

    def _wait_until_due(self, message: RawMessage) -> bool:
        """Wait; return whether the message is to be sent (else the player has been stopped)."""
        while True:
            now = time.monotonic()
            wait_s = self._head.wait_s(message.stamp_ns, now)
            if now - self._polled_s > _POLL_S:
                self._poll(now)
                if self._ended:
                    return False
                continue
            if self._steps and self._head.paused:
                self._steps -= 1
                self._head.jump(message.stamp_ns, now)
                return True
            if wait_s <= 0.0:
                self._errors.add(-wait_s)
                return True
            clock_s = self._clock_s - now if self._clock else _POLL_S
            self._executor.spin_once(max(0.0, min(wait_s, _POLL_S, clock_s)))
            self._publish_clock()

    def _poll(self, now: float) -> None:
        self._polled_s = now
        self._executor.spin_once(0.0)
        for key in self._keyboard.pressed():
            if key == "space":
                self._head.pause(not self._head.paused, now)
            elif key in ("right", "s"):
                self._steps += self._head.paused
            elif key == "q":
                self._quit = True
        self._publish_clock()

    def _publish_clock(self) -> None:
        now = time.monotonic()
        if self._clock is not None and now >= self._clock_s:
            self._clock.publish(conversions.clock(self._head.time_ns(now)))
            period_s = 1.0 / self._parameters.clock_hz
            self._clock_s = max(self._clock_s + period_s, now)

    def _send(self, message: RawMessage) -> None:
        self._outputs[message.topic].send(message.cdr, partial(self._executor.spin_once, 0.001))

    def _on_pause(self, request: Message, response: Message) -> Message:
        self._head.pause(request.data, time.monotonic())
        response.success, response.message = True, "paused" if request.data else "playing"
        return response

    def _on_step(self, request: Message, response: Message) -> Message:
        response.success = self._head.paused
        response.message = "stepping" if self._head.paused else "the player runs: call ~/pause with true first"
        self._steps += self._head.paused
        return response


class PlayerExecutable:
    """The player as a node of its own."""

    def __init__(self, node: ParameterNode) -> None:
        (self._parameters,) = declare(node, PlayerParameters, fixed=PlayerNode.fixed)
        if not self._parameters.bag:
            raise ParameterError("say which bag is played, with the parameter 'bag'")
        self._node = node
        self._bag = read_bag(Path(self._parameters.bag))
        self._player = PlayerNode(node, self._bag, self._parameters)
        take_changes(node, self._parameters, self._player.set_parameters)

    def run(self) -> int:
        """Play; return the exit code."""
        self._node.get_logger().info("ready, waiting for subscribers")
        with self._bag:
            report = self._player.run()
        late = ", ".join(f"{name} {value:.2f}" for name, value in (report.schedule or {}).items())
        self._node.get_logger().info(f"{sum(report.messages.values())} messages played; schedule error: {late}")
        return exit_codes.DONE
