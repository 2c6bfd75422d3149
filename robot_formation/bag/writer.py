"""Write a run as a rosbag2 bag (MCAP) that survives the death of its writer up to the last closed chunk."""

from __future__ import annotations

import hashlib
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from mcap.writer import CompressionType, Writer

from robot_formation.bag.definitions import Definition, definition
from robot_formation.bag.errors import BagError
from robot_formation.bag.metadata import Span, TopicSummary, bag_information, to_yaml
from robot_formation.bag.qos import TopicQos, dump_profiles

T = TypeVar("T")

PARTIAL_SUFFIX = ".partial"
"""What a bag's folder is called while it is being written, behind its name."""
CUT_OFF_SUFFIX = ".cut_off"
"""What the folder of a bag whose writer died is called while the bag is being rescued."""

_COMPRESSION = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
_LAST_STAMP_NS = 2**63 - 1


def check_free(path: Path, leftovers: tuple[str, ...] = (PARTIAL_SUFFIX, CUT_OFF_SUFFIX)) -> None:
    """Refuse a bag's path that is taken, by a bag or by what is left of one.

    Raises:
        BagError: naming what is there.
    """
    if not path.name:
        raise BagError(f"{path} can't be a bag: give the name of a new folder")
    for suffix in ("", *leftovers):
        taken = path.with_name(path.name + suffix)
        if taken.exists():
            raise BagError(f"{taken} exists already and is not overwritten; choose another path or remove it")


class PathReservation:
    """Keeps a bag's path for one run of this machine: a context manager; gone with its process, and no file is left.

    Raises:
        BagError: on entering, if another run has it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path.absolute()
        self._socket: socket.socket | None = None

    def __enter__(self) -> PathReservation:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        name = hashlib.sha256(str(self._path).encode()).hexdigest()
        try:
            self._socket.bind(f"\0robot_formation_bag_{name}")
        except OSError:
            self._socket.close()
            raise BagError(f"{self._path} is being written by another run; choose another path") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._socket is not None:
            self._socket.close()


@dataclass
class _Topic:
    channel_id: int
    summary: TopicSummary
    stamp_ns: int = -1
    log_time_ns: int = -1

    def next_log_time(self, stamp_ns: int) -> int:
        """Return the stamp, or the nanosecond after the topic's last log time where stamps repeat; keep latecomers."""
        if stamp_ns < self.stamp_ns:
            return stamp_ns
        self.stamp_ns = stamp_ns
        self.log_time_ns = max(stamp_ns, self.log_time_ns + 1)
        return self.log_time_ns


class BagWriter:
    """Writes `<path>.partial/` and renames it to `<path>/` when closed: a folder without the suffix is complete.

    The folder holds `<name>_0.mcap` (profile ros2, CDR, embedded definitions, chunks compressed) and `metadata.yaml`
    (version 9, as ROS 2 Jazzy writes it). Use it as a context manager; it is closed, and complete as far as it goes,
    also when the block ends with an exception.

    Args:
        path: the bag's folder; missing parents are made.
        compression: of the chunks: `zstd`, `lz4` or `none`.

    Raises:
        BagError: the bag or its `.partial` exists (nothing is overwritten), or the folder can't be made.
    """

    def __init__(self, path: str | Path, *, compression: str = "zstd") -> None:
        self.path = Path(path).absolute()
        check_free(self.path, (PARTIAL_SUFFIX,))
        self.partial_path = self.path.with_name(self.path.name + PARTIAL_SUFFIX)
        if compression not in _COMPRESSION:
            raise BagError(f"compression can't be {compression!r}; there are: {', '.join(_COMPRESSION)}")
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._span = Span()
        self._closed = False
        self.file_name = f"{self.path.name}_0.mcap"
        with self._system_errors():
            self.partial_path.mkdir(parents=True)
            self._file = (self.partial_path / self.file_name).open("xb")
            self._mcap = Writer(self._file, compression=_COMPRESSION[compression])
            self._mcap.start(profile="ros2")
            self._file.flush()

    @property
    def message_count(self) -> int:
        """Messages written so far."""
        return sum(topic.summary.message_count for topic in self._topics.values())

    @property
    def message_counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: topic.summary.message_count for name, topic in self._topics.items()}

    def add_topic(
        self,
        name: str,
        type_name: str,
        qos: TopicQos | tuple[TopicQos, ...],
        *,
        embedded: Definition | None = None,
    ) -> None:
        """Declare a topic.

        Args:
            name: absolute topic name.
            type_name: message type in full, `std_msgs/msg/String`.
            qos: what the topic's publisher offers, or each of several publishers.
            embedded: the type's definition; by default that of ROS 2 Jazzy.

        Raises:
            BagError: the topic was declared before, or the type is unknown.
        """
        self._check_open()
        if name in self._topics:
            raise BagError(f"{self.path}: topic '{name}' was added before; add each topic once")
        what = embedded or definition(type_name)
        profiles = (qos,) if isinstance(qos, TopicQos) else qos
        if type_name not in self._schemas:
            text = what.text.encode()
            self._schemas[type_name] = self._do(self._mcap.register_schema, type_name, what.encoding, text)
        metadata = {"offered_qos_profiles": dump_profiles(profiles), "topic_type_hash": what.type_hash}
        channel = self._do(self._mcap.register_channel, name, "cdr", self._schemas[type_name], metadata)
        self._topics[name] = _Topic(channel, TopicSummary(name, type_name, what.type_hash, profiles))

    def write(self, topic: str, cdr: bytes, stamp_ns: int, *, log_time_ns: int | None = None) -> None:
        """Append one serialised message.

        Publish time is the stamp. Log time is the stamp too, but for messages of one topic with equal stamps (a world
        that stands still) it counts up by a nanosecond, because players may reorder equal log times.

        Args:
            topic: a name given to `add_topic`.
            cdr: the message as CDR with its encapsulation header.
            stamp_ns: nanoseconds, 0 to 2^63 - 1.
            log_time_ns: keep this log time instead (copies of another recorder's bag).

        Raises:
            BagError: unknown topic, a stamp out of range, or the file can't be written (disk full).
        """
        self._check_open()
        entry = self._topics.get(topic)
        if entry is None:
            raise BagError(f"{self.path}: topic '{topic}' is unknown; add it with its type first")
        log_time = entry.next_log_time(stamp_ns) if log_time_ns is None else log_time_ns
        if not (0 <= stamp_ns <= _LAST_STAMP_NS and 0 <= log_time <= _LAST_STAMP_NS):
            raise BagError(f"{self.path}: '{topic}' has a message stamped {stamp_ns} ns; give stamps of 0 to 2^63 - 1")
        self._do(self._mcap.add_message, entry.channel_id, log_time, cdr, stamp_ns, entry.summary.message_count)
        entry.summary.message_count += 1
        self._span.include(log_time)

    def end_chunk(self) -> None:
        """Close the current chunk and hand it to the operating system: what was written survives SIGKILL.

        A crash of the machine itself can still lose it (there is no fsync).

        Raises:
            BagError: the file can't be written.
        """
        self._check_open()
        self._do(self._mcap.flush)

    def write_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write an MCAP metadata record at this place of the file.

        Raises:
            BagError: a value isn't a string, or the file can't be written.
        """
        self._check_open()
        wrong = [key for key, value in values.items() if not isinstance(value, str)]
        if wrong:
            raise BagError(f"{self.path}: metadata '{name}' must hold strings only; convert {', '.join(wrong)}")
        self._do(self._mcap.add_metadata, name, dict(values))

    def close(self) -> Path:
        """Finish the file, write `metadata.yaml` and give the folder its final name; return its path.

        Raises:
            BagError: the file can't be written, or the path has been taken meanwhile; the `.partial` folder stays.
        """
        if self._closed:
            return self.path
        self._closed = True
        summaries = [topic.summary for topic in self._topics.values()]
        information = bag_information(self.file_name, summaries, self._span)
        with self._system_errors(), self._file:
            # rosbag2 looks up in this record which version the channels' QoS text follows.
            self._mcap.add_metadata("rosbag2", {"serialized_metadata": to_yaml(information)})
            self._mcap.finish()
        if self.path.exists():
            raise BagError(f"{self.path} was made by somebody else meanwhile; the bag stays in {self.partial_path}")
        with self._system_errors():
            text = to_yaml({"rosbag2_bagfile_information": information})
            (self.partial_path / "metadata.yaml").write_text(text, encoding="utf-8")
            self.partial_path.rename(self.path)
        return self.path

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._closed:
            raise BagError(f"{self.path} is closed; nothing more can be written to it")

    def _do(self, action: Callable[..., T], *arguments: Any) -> T:
        try:
            return action(*arguments)
        except OSError as error:
            raise self._unwritable(error) from error

    @contextmanager
    def _system_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> BagError:
        return BagError(
            f"{self.path}: can't write the bag: {error.strerror or error}; free space or choose another path"
        )
