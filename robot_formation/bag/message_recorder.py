"""Records a stream of raw messages: finds their simulated time, and ends chunks so that little is lost."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from robot_formation import names
from robot_formation.bag.definitions import Definition, definition
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.transforms import Transforms
from robot_formation.bag.write_options import DEFAULT_OPTIONS, WriteOptions
from robot_formation.bag.writer import BagWriter

METADATA_NAME = "robot_formation"


class Recorder:
    """Writes messages into a bag.

    Their log time is simulated: their own stamp, or the latest one seen before them; or, where `record` is told when
    they came, that time. It adds /tf and /tf_static, made of true poses and robot descriptions, when it ends a chunk,
    unless such a topic was declared before; one that is declared later is recorded beside them, in the same topic.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str], options: WriteOptions = DEFAULT_OPTIONS) -> None:
        """Open the bag.

        Args:
            path: the bag's folder, which must not exist.
            metadata: texts of the MCAP metadata record `robot_formation`.
            options: how the files are written.

        Raises:
            BagError: if the path is taken or can't be written.
        """
        self._writer = BagWriter(path, options=options)
        self._chunk_bytes = options.chunk_bytes
        if metadata:
            self._writer.write_metadata(METADATA_NAME, metadata)
        self._topics: set[str] = set()
        self._own: dict[str, str] = {}  # topics made here, and their types
        self._transforms = Transforms()
        self._now_ns = 0

    @property
    def topics(self) -> set[str]:
        """Names of the topics recorded so far."""
        return self._topics

    @property
    def now_ns(self) -> int:
        """The latest stamp so far, nanoseconds: that of messages that have none of their own."""
        return self._now_ns

    @property
    def message_count(self) -> int:
        """Messages recorded so far."""
        return self._writer.message_count

    @property
    def message_counts(self) -> dict[str, int]:
        """Messages recorded so far, by topic."""
        return self._writer.message_counts

    def add_topic(
        self, name: str, type_name: str, qos: TopicQos | tuple[TopicQos, ...], *, embedded: Definition | None = None
    ) -> None:
        """Declare a topic once; arguments as for `BagWriter.add_topic`.

        Raises:
            BagError: the topic was declared before, or it is one that the recorder adds and its type is another.
        """
        if self._own.get(name) != type_name:
            self._writer.add_topic(name, type_name, qos, embedded=embedded)
        self._topics.add(name)

    def record(self, topic: str, type_name: str, cdr: bytes, received_ns: int | None = None) -> None:
        """Write one serialised message of a declared topic.

        Args:
            topic: its topic.
            type_name: its type in full.
            cdr: the message with its encapsulation header.
            received_ns: when it came, nanoseconds, to keep receive times; None for simulated time.
        """
        stamp_ns = own_stamp(type_name, cdr) if received_ns is None else received_ns
        if stamp_ns is None:
            stamp_ns = self._now_ns
        else:
            self._now_ns = max(self._now_ns, stamp_ns)
        # A middleware delivers payloads in words of four bytes (DDSI-RTPS 2.3, section 9.4): so do all our bags.
        self._writer.write(topic, cdr + bytes(-len(cdr) % 4), stamp_ns)
        self._transforms.take(topic, type_name, cdr, stamp_ns)
        if self._writer.open_bytes >= self._chunk_bytes:
            self.end_chunk()

    def write_metadata(self, metadata: Mapping[str, str]) -> None:
        """Add to the metadata record; later values replace earlier ones."""
        self._writer.write_metadata(METADATA_NAME, metadata)

    def end_chunk(self) -> None:
        """Make what was recorded so far survive the recorder's death."""
        if self._writer.open_bytes:
            self._add_transforms()
            self._writer.end_chunk()

    def record_as(self, name: str, topic: names.Topic, cdr: bytes) -> None:
        """Record a message of one of the project's topics under its full name; the first one declares it.

        Raises:
            BagError: as for `add_topic` and `record`.
        """
        if name not in self._topics:
            self.add_topic(name, topic.type, TopicQos.of(topic.qos))
        self.record(name, topic.type, cdr)

    def close(self) -> Path:
        """Finish the bag; return its path.

        Raises:
            BagError: the disk refuses; the `.partial` folder stays.
        """
        try:
            self._add_transforms()
        finally:
            path = self._writer.close()
        return path

    def _add_transforms(self) -> None:
        for topic, cdr, stamp_ns in self._transforms.make():
            if topic.name not in self._own:
                if topic.name in self._topics:
                    continue  # somebody publishes it
                self.add_topic(topic.name, topic.type, TopicQos.of(topic.qos))
                self._own[topic.name] = topic.type
            self._writer.write(topic.name, cdr, stamp_ns)


@cache
def _has_time_first(type_name: str) -> bool:
    return definition(type_name).begins_with_time


def own_stamp(type_name: str, cdr: bytes) -> int | None:
    """Read the time that a message begins with, in nanoseconds; None if its type has none or it is negative."""
    if not _has_time_first(type_name) or len(cdr) < 12:
        return None
    order = "little" if cdr[1] & 1 else "big"
    seconds = int.from_bytes(cdr[4:8], order, signed=True)  # type: ignore[arg-type]
    nanoseconds = int.from_bytes(cdr[8:12], order)  # type: ignore[arg-type]
    return seconds * 1_000_000_000 + nanoseconds if seconds >= 0 else None
