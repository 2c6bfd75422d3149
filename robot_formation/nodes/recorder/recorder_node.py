"""The `recorder` executable: any topics, raw, into an MCAP bag."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robot_formation import conversions, exit_codes, names
from robot_formation.bag.definitions import definition
from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import Recorder
from robot_formation.bag.recording_queue import QUEUE_BYTES, RecordingQueue
from robot_formation.bag.selection import Selection
from robot_formation.bag.transforms import Transforms, made_in
from robot_formation.bag.write_options import CHUNK_BYTES, WriteOptions
from robot_formation.names import Message
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.ros_parameters import HostParameters, ParameterNode, declare
from robot_formation.nodes.host.signals import stopped
from robot_formation.nodes.recorder.intake import Intake
from robot_formation.nodes.recorder.parameter_snapshot import ParameterSnapshot
from robot_formation.nodes.recorder.recorder_health import RecorderHealth
from robot_formation.nodes.recorder.topic_qos import accepting, accepts, offered
from robot_formation.parameters import Choice, ParameterError, parameter

_DISCOVERY_S = 0.05
_REVIEW_S = 1.0
_TICK_TYPE = "std_msgs/msg/UInt32"
_AFTER_TICK_S = 0.01  # what belongs to a timestep arrives well within this after its tick
_IDLE_S = 0.03
_OLDEST_CHUNK_S = 1.0
_ROUND_S = 0.01
_QUIET_ROUNDS = 4  # without a message after the signal to end: everything sent has arrived
_LONGEST_DRAIN_S = 5.0


class LogTime(Choice):
    """Which time a recorded message gets: its own stamp or the latest one before it, or the wall clock."""

    SIMULATED = "simulated"
    RECEIVE = "receive"


class Compression(Choice):
    """How a bag's chunks are compressed."""

    ZSTD = "zstd"
    NONE = "none"


@dataclass(frozen=True)
class RecorderParameters:
    """What is recorded and where."""

    path: str = parameter("", "Folder of the bag; it must not exist")
    topics: tuple[str, ...] = parameter((), "Topics to record; with an empty 'regex' too, all are recorded")
    regex: str = parameter("", "Regular expression of topics to record, matched as a whole")
    exclude: str = parameter(
        "/parameter_events|/rosout|.*/transition_event",
        "Regular expression of topics that are left out unless 'topics' names them, matched as a whole",
    )
    images: bool = parameter(
        False, "Record pictures too where 'topics' doesn't name them: noisy frames are 126 MB per thousand"
    )
    own_namespace: bool = parameter(
        False,
        "Record only what lies in the recorder's own namespace or 'topics' names, and of /diagnostics what is said of "
        "the nodes there",
    )
    time: LogTime = parameter(
        LogTime.SIMULATED,
        "Log times: a message's own stamp or the latest one before it (simulated), or the wall clock (receive)",
    )
    compression: Compression = parameter(Compression.ZSTD, "Compression of the chunks")
    chunk_bytes: int = parameter(CHUNK_BYTES, "Size at which a chunk is closed", unit="B", low=1024, high=2**30)
    split_bytes: int = parameter(
        0, "Size of a file after which the next one is begun; 0: never", unit="B", low=0, high=2**62
    )
    split_s: float = parameter(
        0.0, "Log time in a file after which the next one is begun; 0: never", unit="s", low=0.0, high=1e9
    )
    queue_bytes: int = parameter(
        QUEUE_BYTES, "Messages that may wait for the disk; what goes beyond is dropped and told", unit="B", low=1024,
        high=2**40,
    )  # fmt: skip
    metadata: tuple[str, ...] = parameter((), "Texts 'key=value' for the bag's metadata record")

    def selection(self, resolve: Callable[[str], str], namespace: str) -> Selection:
        """Return which topics are meant; `resolve` makes names absolute, `namespace` is the recorder's.

        Raises:
            BagError: a regular expression is none.
        """
        within = namespace.rstrip("/") if self.own_namespace else ""
        topics = tuple(resolve(topic) for topic in self.topics)
        return Selection(topics, self.regex, self.exclude, self.images, within)

    def write_options(self) -> WriteOptions:
        """Return how the files are written."""
        return WriteOptions(self.compression, self.chunk_bytes, self.split_bytes, round(self.split_s * 1e9))

    def texts(self) -> dict[str, str]:
        """Split the metadata.

        Raises:
            ParameterError: a text has no '='.
        """
        for text in self.metadata:
            if "=" not in text:
                raise ParameterError(f"'metadata' takes texts like key=value, not '{text}'")
        return dict(text.split("=", 1) for text in self.metadata)


@dataclass(frozen=True)
class RecordReport:
    """What was recorded: the bag, and messages by topic: written, dropped by the queue, lost by the middleware.

    `unseen` are topics that were named and never appeared.
    """

    path: Path
    message_counts: Mapping[str, int]
    dropped: Mapping[str, int]
    lost: Mapping[str, int]
    unseen: tuple[str, ...]


class RecorderNode:
    """Discovers topics, subscribes raw with their publishers' QoS and writes what arrives.

    Args:
        node: joins the graph.
        parameters: what is recorded and where.
        say: told of each topic that is recorded; by default nobody.
        warn: told what is not; by default the node's log.
        ask: whether the parameters of all nodes are asked for and put into the bag's metadata.
    """

    fixed: ClassVar[Mapping[str, str]] = {"*": "the bag was begun with it; record another one"}
    """Parameters that can't be set while it records, and why."""

    def __init__(
        self,
        node: Node,
        parameters: RecorderParameters,
        say: Callable[[str], None] = lambda text: None,
        warn: Callable[[str], None] | None = None,
        *,
        ask: bool = False,
    ) -> None:
        if not parameters.path:
            raise ParameterError("say where the bag goes, with the parameter 'path'")
        self._node, self._parameters, self._say = node, parameters, say
        self._warn: Callable[[str], None] = warn or (lambda text: node.get_logger().warning(text))
        self._selection = parameters.selection(node.resolve_topic_name, node.get_namespace())
        self._recorder = Recorder(Path(parameters.path), parameters.texts(), parameters.write_options())
        self._queue = RecordingQueue(self._recorder, parameters.queue_bytes)
        self._receive_time = parameters.time is LogTime.RECEIVE
        self._subscribed: dict[str, Intake] = {}
        # Topics that the bag's recorder makes itself of true poses, or is likely to, and their types.
        self._made = {**made_in(""), **made_in(node.get_namespace())}
        self._ignored: set[str] = set()
        self._refused: set[tuple[int, ...]] = set()
        self._told_dropped = 0
        self._messages = 0  # of those that are recorded
        self._arrived = 0
        self._chunk_at = time.monotonic()
        self._tick_at: float | None = None
        self._snapshot = ParameterSnapshot(node, self._keep) if ask else None
        self._health = RecorderHealth(node, parameters.path)

    def run(self, stop: Callable[[], bool] = stopped) -> RecordReport:
        """Record until `stop` says so; then take what is still on its way and close the bag.

        Raises:
            BagError: the bag can't be written further; what was written stays in the `.partial` folder.
        """
        executor = make_executor(self._node.context)
        executor.add_node(self._node)
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        timers = [
            self._node.create_timer(_DISCOVERY_S, self._discover, clock=clock),
            self._node.create_timer(_REVIEW_S, self._review, clock=clock),
        ]
        try:
            while not stop():
                before = self._messages
                executor.spin_once(_IDLE_S if self._tick_at is None else _AFTER_TICK_S)
                self._queue.check()
                self._end_chunk(idle=self._messages == before)
            for timer in timers:
                timer.cancel()
            self._drain(executor)
            self._queue.finish()
            return self._close()
        finally:
            self._queue.stop()
            executor.shutdown()

    def _close(self) -> RecordReport:
        if self._queue.dropped or self._lost:
            incomplete = {"dropped": json.dumps(self._queue.dropped), "lost": json.dumps(self._lost)}
            self._recorder.write_metadata(incomplete)
        unseen = tuple(sorted(set(self._selection.topics) - set(self._subscribed)))
        path = self._recorder.close()
        return RecordReport(path, self._recorder.message_counts, self._queue.dropped, self._lost, unseen)

    def _end_chunk(self, *, idle: bool) -> None:
        """Close a chunk soon after every tick, whenever nothing arrives, and when it is old."""
        now = time.monotonic()
        due = self._tick_at is not None and now - self._tick_at > _AFTER_TICK_S
        if self._messages and (idle or due or now - self._chunk_at > _OLDEST_CHUNK_S):
            self._tick_at = None
            self._chunk_at = now
            self._queue.call(self._recorder.end_chunk)

    def _drain(self, executor: Executor) -> None:
        end = time.monotonic() + _LONGEST_DRAIN_S
        quiet = 0
        # Rounds are counted, not time: on a busy machine this process may not run for longer than any silence.
        while quiet < _QUIET_ROUNDS and time.monotonic() < end:
            before = self._arrived
            executor.spin_once(_ROUND_S)
            quiet = 0 if self._arrived != before else quiet + 1

    def _discover(self) -> None:
        for name, types in self._node.get_topic_names_and_types():
            if name in self._subscribed or name in self._ignored:
                continue
            if not self._selection.wants(name, types[0]):
                self._ignored.add(name)
                continue
            infos = self._node.get_publishers_info_by_topic(name)
            infos = [info for info in infos if not self._health.publishes(info.node_name, info.node_namespace)]
            if infos:
                self._subscribe(name, types, infos)

    def _subscribe(self, name: str, types: list[str], infos: list[TopicEndpointInfo]) -> None:
        type_name = types[0]
        made = self._made.get(name, type_name)
        if type_name != made:
            self._ignored.add(name)
            self._warn(f"{name} is not recorded: its type is {type_name} instead of {made}")
            return
        try:
            message_class: type[Message] = conversions.message_class(type_name)
            what = definition(type_name)
        except (BagError, ImportError, AttributeError, ValueError) as error:
            self._ignored.add(name)
            self._warn(f"{name} is not recorded: {error}")
            return
        if len(types) > 1:
            self._warn(f"{name} has several types; only {type_name} is recorded")
        if any(str(info.topic_type_hash) not in (what.type_hash, "INVALID") for info in infos):
            self._warn(f"{name} is published with another version of {type_name}: its definition in the bag won't fit")
        self._made.update(Transforms.made_of(name, type_name))
        profiles = tuple(offered(info) for info in infos)
        self._queue.call(partial(self._recorder.add_topic, name, type_name, profiles, embedded=what))
        take = partial(self._on_message, name, type_name)
        self._subscribed[name] = Intake(self._node, name, message_class, accepting(infos), len(infos), take)
        self._say(f"recording {name} ({type_name})")

    def _on_message(self, topic: str, type_name: str, data: bytes) -> None:
        self._arrived += 1
        if self._health.is_own(topic, data) or self._is_of_others(topic, data):
            return
        self._messages += 1
        self._queue.put(topic, type_name, data, time.time_ns() if self._receive_time else None)
        if type_name == _TICK_TYPE:
            self._tick_at = time.monotonic()

    @property
    def _lost(self) -> Counter[str]:
        return Counter({topic: intake.lost for topic, intake in self._subscribed.items() if intake.lost})

    def _is_of_others(self, topic: str, data: bytes) -> bool:
        """Return whether a message on the one topic that all formations share says nothing of this one's nodes."""
        namespace = self._selection.namespace
        if not namespace or topic != names.DIAGNOSTICS.name or topic in self._selection.topics:
            return False
        try:
            reports = conversions.from_cdr(data, names.DIAGNOSTICS.type).status
        except Exception:  # the middleware's decoders have no common error
            return True
        return not any(report.name.startswith(f"{namespace}/") for report in reports)

    def _keep(self, key: str, text: str) -> None:
        self._queue.call(partial(self._recorder.write_metadata, {key: text}))

    def _review(self) -> None:
        """Report the state, and which publishers the subscriptions made so far don't reach."""
        if self._snapshot is not None:
            self._snapshot.look()
        for name, intake in self._subscribed.items():
            infos = self._node.get_publishers_info_by_topic(name)
            intake.publishers = len(infos)
            for info in infos:
                gid = tuple(info.endpoint_gid)
                if gid not in self._refused and not accepts(intake.qos, info):
                    self._refused.add(gid)
                    self._warn(f"{name} is also published by {info.node_name} with a weaker QoS: that is not recorded")
        dropped = sum(self._queue.dropped.values())
        if dropped > self._told_dropped:
            self._warn(f"{dropped} messages dropped: the disk is too slow for 'queue_bytes'")
            self._told_dropped = dropped
        queue = self._queue
        self._health.publish(
            self._recorder.now_ns, self._messages, len(self._subscribed), queue.waiting_bytes, queue.dropped, self._lost
        )


class RecorderExecutable:
    """The recorder as a node of its own."""

    def __init__(self, node: ParameterNode) -> None:
        parameters, _ = declare(node, RecorderParameters, HostParameters, fixed=RecorderNode.fixed)
        self._node = node
        self._recorder = RecorderNode(node, parameters)

    def run(self) -> int:
        """Record; return the exit code."""
        self._node.get_logger().info("ready, recording what is published")
        report = self._recorder.run()
        for topic in report.unseen:
            self._node.get_logger().warning(f"nobody has published {topic}")
        self._node.get_logger().info(f"{sum(report.message_counts.values())} messages in {report.path}")
        return exit_codes.DONE
