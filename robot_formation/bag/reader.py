"""Read any ROS 2 bag without ROS, by the message definitions that it carries."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from robot_formation.bag.definitions import jazzy_typestore
from robot_formation.bag.errors import BagError
from robot_formation.bag.metadata import TopicSummary
from robot_formation.bag.place import PARTIAL_SUFFIX
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.recover import in_order, mcap_files, recover

_STORAGES = (".mcap", ".db3")
_END_MAGIC = b"\x89MCAP0\r\n"


class BagMessage(NamedTuple):
    """One message: topic, type, the bag's stamp (log time, nanoseconds), and the message as rosbags gives it."""

    topic: str
    type_name: str
    stamp_ns: int
    message: Any


class RawMessage(NamedTuple):
    """One message as it was recorded: topic, type, the bag's stamp (log time, nanoseconds), and its CDR."""

    topic: str
    type_name: str
    stamp_ns: int
    cdr: bytes


class Bag:
    """An open bag; use it as a context manager. Made by `read_bag`.

    Attributes:
        path: what was asked for.
        recovered: the bag had not been closed by its writer.
    """

    def __init__(
        self, path: Path, reader: AnyReader, records: list[tuple[str, dict[str, str]]], stack: ExitStack
    ) -> None:
        self.path = path
        self.recovered = False
        self._reader = reader
        self._records = records
        self._stack = stack

    @property
    def topics(self) -> dict[str, str]:
        """Topics that hold at least one message, with their message types."""
        return {connection.topic: connection.msgtype for connection in self._reader.connections if connection.msgcount}

    @property
    def contents(self) -> list[TopicSummary]:
        """Every declared topic with its number of messages, sorted by name; empty topics included."""
        found: dict[str, TopicSummary] = {}
        for connection in sorted(self._reader.connections, key=lambda connection: str(connection.topic)):
            offered = tuple(_qos(profile) for profile in connection.ext.offered_qos_profiles)
            topic = TopicSummary(
                connection.topic, connection.msgtype, connection.digest, offered, int(connection.msgcount)
            )
            known = found.setdefault(connection.topic, topic)
            if known is not topic:  # one channel per file, or per publisher
                known.message_count += topic.message_count
                known.profiles += tuple(profile for profile in offered if profile not in known.profiles)
        return list(found.values())

    @property
    def ros_distro(self) -> str:
        """ROS distribution that recorded the bag; empty if it doesn't say."""
        return next((str(reader.ros_distro) for reader in self._reader.readers if reader.ros_distro), "")

    @property
    def outer_compression(self) -> str:
        """rosbag2's own compression of the bag, of whole files or of single messages; empty for none."""
        kinds = {(reader.compression_format, reader.compression_mode) for reader in self._reader.readers}
        return ", ".join(f"{form} ({mode})" for form, mode in sorted(kinds, key=str) if mode)

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return int(self._reader.message_count)

    @property
    def start_ns(self) -> int:
        """Stamp of the first message, nanoseconds; 0 in an empty bag."""
        return int(self._reader.start_time) if self.message_count else 0

    @property
    def end_ns(self) -> int:
        """Stamp of the last message, nanoseconds; 0 in an empty bag."""
        return int(self._reader.end_time) - 1 if self.message_count else 0

    @property
    def duration_s(self) -> float:
        """Seconds from the first message's stamp to the last one's."""
        return (self.end_ns - self.start_ns) * 1e-9

    def metadata(self, name: str) -> dict[str, str]:
        """Return the MCAP metadata of this name; later records add to and replace values of earlier ones."""
        merged: dict[str, str] = {}
        for found, values in self._records:
            if found == name:
                merged.update(values)
        return merged

    def require(self, types: dict[str, str]) -> None:
        """Check that the topics are there with these message types.

        Raises:
            BagError: naming the first topic that is missing or of another type.
        """
        there = self.topics
        for topic, type_name in types.items():
            if topic not in there:
                raise BagError(f"{self.path} has no messages on '{topic}', which is needed; record that topic too")
            if there[topic] != type_name:
                raise BagError(f"{self.path}: '{topic}' is {there[topic]}, but {type_name} is needed")

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Yield the messages of these topics in the order of their stamps.

        Raises:
            BagError: the bag is corrupted.
        """
        for raw in self.raw_messages(topics):
            try:
                message = self._reader.deserialize(raw.cdr, raw.type_name)
            except Exception as error:  # rosbags' decoders have no common error
                raise _corrupted(self.path, error) from error
            yield BagMessage(raw.topic, raw.type_name, raw.stamp_ns, message)

    def raw_messages(
        self, topics: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Yield the messages of these topics as they were recorded, in the order of their stamps.

        Args:
            topics: their names.
            start_ns: leave out what is earlier.
            stop_ns: leave out this and what is later.

        Raises:
            BagError: the bag is corrupted.
        """
        connections = [connection for connection in self._reader.connections if connection.topic in topics]
        if not connections:
            return
        found = self._reader.messages(connections=connections, start=start_ns, stop=stop_ns)
        while True:
            try:
                connection, stamp_ns, data = next(found)
            except StopIteration:
                return
            # rosbags lets errors of its decompressors through, which have no common base.
            except Exception as error:
                raise _corrupted(self.path, error) from error
            yield RawMessage(connection.topic, connection.msgtype, stamp_ns, bytes(data))

    def close(self) -> None:
        """Close the bag and remove what was recovered for reading."""
        self._stack.close()

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_bag(path: str | Path, *, allow_empty: bool = False) -> Bag:
    """Open a bag: a finished folder, one .mcap or .db3 file, or one whose writer was killed.

    An unclosed bag (a `.partial` folder, a folder without metadata.yaml, an MCAP file without its end) is recovered
    into a temporary folder, which is removed when the bag is closed.

    Args:
        path: the bag.
        allow_empty: whether a bag without messages is one.

    Raises:
        BagError: the path is missing, not a bag, empty or corrupted.
    """
    asked = Path(path)
    stack = ExitStack()
    try:
        readable = _recovered(asked, stack) if _is_unclosed(asked) else asked
        # SQLite bags without metadata.yaml: their writer was killed, but the files are whole.
        loose = readable.is_dir() and not (readable / "metadata.yaml").exists()
        reader = AnyReader(storage_files(readable) if loose else [readable], default_typestore=jazzy_typestore())
        stack.enter_context(reader)
        bag = Bag(asked, reader, _metadata_records(readable), stack)
        if bag.message_count == 0 and not allow_empty:
            raise BagError(f"{asked} is empty: it holds no messages")
    except Exception as error:
        stack.close()
        raise _corrupted(asked, error) from error
    bag.recovered = readable is not asked
    return bag


def storage_files(path: Path) -> list[Path]:
    """List a bag's storage files in order, whichever storage it is."""
    if not path.is_dir():
        return [path]
    return sorted((file for kind in _STORAGES for file in path.glob(f"*{kind}*")), key=in_order)


def bag_name(path: str | Path) -> str:
    """Return a bag's name without the suffixes of unclosed bags and storage files."""
    name = Path(path).resolve().name
    for suffix in (PARTIAL_SUFFIX, ".mcap", ".db3"):
        name = name.removesuffix(suffix)
    return name


def _is_unclosed(path: Path) -> bool:
    """Tell whether a bag was never closed by its writer; check on the way that it is one."""
    if path.exists() and (path.suffix == ".db3" or (path.is_dir() and any(path.glob("*.db3")))):
        return False
    if path.is_dir() and not (path / "metadata.yaml").exists():
        return bool(mcap_files(path))
    return any(_lacks_end(file) for file in mcap_files(path))


def _lacks_end(file: Path) -> bool:
    """Tell whether an MCAP file begins as one but doesn't end as one."""
    with file.open("rb") as stream:
        head = stream.read(len(_END_MAGIC))
        stream.seek(max(0, file.stat().st_size - len(_END_MAGIC)))
        return head == _END_MAGIC and (stream.tell() == 0 or stream.read() != _END_MAGIC)


def _recovered(path: Path, stack: ExitStack) -> Path:
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="robot_formation_")))
    return recover(path, folder / bag_name(path)).path


def _metadata_records(path: Path) -> list[tuple[str, dict[str, str]]]:
    files = sorted(path.glob("*.mcap"), key=in_order) if path.is_dir() else [path] if path.suffix == ".mcap" else []
    records: list[tuple[str, dict[str, str]]] = []
    for file in files:
        with file.open("rb") as stream:
            records.extend((record.name, record.metadata) for record in make_reader(stream).iter_metadata())
    return records


def _qos(profile: Any) -> TopicQos:
    """Convert rosbags' profile."""
    times = (profile.deadline, profile.lifespan, profile.liveliness_lease_duration)
    deadline_ns, lifespan_ns, lease_ns = (time.sec * 10**9 + time.nsec for time in times)
    return TopicQos(
        profile.history.name.lower(),
        max(0, profile.depth),
        profile.reliability.name.lower(),
        profile.durability.name.lower(),
        deadline_ns,
        lifespan_ns,
        "unknown" if profile.liveliness.name == "MANUAL_BY_NODE" else profile.liveliness.name.lower(),
        lease_ns,
        profile.avoid_ros_namespace_conventions,
    )


def _corrupted(path: Path, error: Exception) -> BagError:
    if isinstance(error, BagError):
        return error
    reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    return BagError(f"{path} can't be read: {reason}; it may be damaged, or no bag")
