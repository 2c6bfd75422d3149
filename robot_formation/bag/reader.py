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
from robot_formation.bag.recover import mcap_files, recover
from robot_formation.bag.writer import PARTIAL_SUFFIX

_END_MAGIC = b"\x89MCAP0\r\n"


class BagMessage(NamedTuple):
    """One message: topic, type, the bag's stamp (log time, nanoseconds), and the message as rosbags gives it."""

    topic: str
    type_name: str
    stamp_ns: int
    message: Any


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
    def message_count(self) -> int:
        """Messages in the bag."""
        return int(self._reader.message_count)

    @property
    def duration_s(self) -> float:
        """Seconds from the first message's stamp to the last one's."""
        return float(max(0, self._reader.end_time - 1 - self._reader.start_time)) * 1e-9

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
        connections = [connection for connection in self._reader.connections if connection.topic in topics]
        if not connections:
            return
        try:
            for connection, stamp_ns, data in self._reader.messages(connections=connections):
                message = self._reader.deserialize(data, connection.msgtype)
                yield BagMessage(connection.topic, connection.msgtype, stamp_ns, message)
        # rosbags lets errors of its decompressors and decoders through, which have no common base.
        except Exception as error:
            raise _corrupted(self.path, error) from error

    def close(self) -> None:
        """Close the bag and remove what was recovered for reading."""
        self._stack.close()

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_bag(path: str | Path) -> Bag:
    """Open a bag: a finished folder, one .mcap or .db3 file, or one whose writer was killed.

    An unclosed bag (a `.partial` folder, a folder without metadata.yaml, an MCAP file without its end) is recovered
    into a temporary folder, which is removed when the bag is closed.

    Raises:
        BagError: the path is missing, not a bag, empty or corrupted.
    """
    asked = Path(path)
    stack = ExitStack()
    try:
        readable = _recovered(asked, stack) if _is_unclosed(asked) else asked
        reader = AnyReader([readable], default_typestore=jazzy_typestore())
        stack.enter_context(reader)
        bag = Bag(asked, reader, _metadata_records(readable), stack)
        if bag.message_count == 0:
            raise BagError(f"{asked} is empty: it holds no messages")
    except Exception as error:
        stack.close()
        raise _corrupted(asked, error) from error
    bag.recovered = readable is not asked
    return bag


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
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path] if path.suffix == ".mcap" else []
    records: list[tuple[str, dict[str, str]]] = []
    for file in files:
        with file.open("rb") as stream:
            records.extend((record.name, record.metadata) for record in make_reader(stream).iter_metadata())
    return records


def _corrupted(path: Path, error: Exception) -> BagError:
    if isinstance(error, BagError):
        return error
    reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    return BagError(f"{path} can't be read: {reason}; it may be damaged, or no bag")
