"""Read any ROS 2 bag without ROS, by the message definitions that it carries."""

from __future__ import annotations

import heapq
import logging
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from robot_formation.bag.definitions import jazzy_typestore
from robot_formation.bag.errors import BagError
from robot_formation.bag.folder import FolderMetadata, readable, storage_of
from robot_formation.bag.mcap_chunks import unpacked_message
from robot_formation.bag.mcap_source import McapSource
from robot_formation.bag.metadata import TopicSummary
from robot_formation.bag.source import RawMessage, Source
from robot_formation.bag.sqlite_source import SqliteSource
from robot_formation.errors import shown
from robot_formation.names import Message

_LOG = logging.getLogger(__name__)
_IDL_FILE = "=" * 80 + "\n"


class BagMessage(NamedTuple):
    """One message: topic, type, the bag's stamp (log time, nanoseconds), and the message as rosbags gives it."""

    topic: str
    type_name: str
    stamp_ns: int
    message: Message


class Bag:
    """An open bag; use it as a context manager. Made by `read_bag`.

    Attributes:
        path: what was asked for.
        recovered: the bag had not been closed by its writer.
        contents: every declared topic with its number of messages, sorted by name; empty topics included.
        message_count: messages in the bag.
        start_ns: stamp of the first message, nanoseconds; 0 in an empty bag.
        end_ns: stamp of the last message, nanoseconds; 0 in an empty bag.
        warnings: what is wrong with the bag though it can be read, a line each.
    """

    def __init__(
        self,
        path: Path,
        sources: Sequence[Source],
        metadata: FolderMetadata | None,
        stack: ExitStack,
        *,
        recovered: bool,
    ) -> None:
        self.path = path
        self.recovered = recovered
        self._sources = sources
        self._metadata = metadata or FolderMetadata(())
        self._stack = stack
        self._typestore = _typestore(sources)
        self.contents = _merged(sources, self._metadata)
        filled = [source for source in sources if source.message_count]
        self.message_count = sum(source.message_count for source in filled)
        self.start_ns = min((source.start_ns for source in filled), default=0)
        self.end_ns = max((source.end_ns for source in filled), default=0)
        self.warnings = [f"{path}: {warning}" for source in sources for warning in source.warnings]
        if metadata is not None and not recovered:
            self.warnings += _differences(path, metadata, self.contents)

    @property
    def topics(self) -> dict[str, str]:
        """Topics that hold at least one message, with their message types."""
        return {topic.name: topic.type_name for topic in self.contents if topic.message_count}

    @property
    def ros_distro(self) -> str:
        """ROS distribution that recorded the bag; empty if it doesn't say."""
        return self._metadata.ros_distro

    @property
    def compression(self) -> str:
        """How the bag is compressed: rosbag2's own way and mode, or that of its chunks; `none` without."""
        if self._metadata.compression_mode:
            return f"{self._metadata.compression_format} ({self._metadata.compression_mode})"
        return ", ".join(sorted(set().union(*(source.compressions for source in self._sources)))) or "none"

    @property
    def duration_s(self) -> float:
        """Seconds from the first message's stamp to the last one's."""
        return (self.end_ns - self.start_ns) * 1e-9

    def metadata(self, name: str) -> dict[str, str]:
        """Return the MCAP metadata of this name; later records add to and replace values of earlier ones."""
        merged: dict[str, str] = {}
        for source in self._sources:
            for found, values in source.records:
                if found == name:
                    merged.update(values)
        return merged

    def require(self, types: dict[str, str]) -> None:
        """Check that the topics are there with these message types of ROS 2 Jazzy.

        Raises:
            BagError: naming the first topic that is missing, of another type, or whose type has other fields.
        """
        there = self.topics
        for topic, type_name in types.items():
            if topic not in there:
                raise BagError(f"{self.path} has no messages on '{topic}', which is needed; record that topic too")
            if there[topic] != type_name:
                raise BagError(f"{self.path}: '{topic}' is {there[topic]}, but {type_name} is needed")
            if self._hash(type_name) != jazzy_typestore().hash_rihs01(type_name):
                raise BagError(
                    f"{self.path}: '{topic}' is a {type_name} with other fields than in ROS 2 Jazzy; it can't be used"
                )

    def _hash(self, type_name: str) -> object:
        try:
            return self._typestore.hash_rihs01(type_name)
        except Exception:  # rosbags' type store has no common error
            return None

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[BagMessage]:
        """Yield the messages of these topics in the order of their stamps; arguments as for `raw_messages`.

        Raises:
            BagError: the bag is corrupted, or holds less than it says.
        """
        for raw in self.raw_messages(topics, start_ns, stop_ns):
            yield self.decoded(raw)

    def decoded(self, raw: RawMessage) -> BagMessage:
        """Decode a message of this bag.

        Raises:
            BagError: the bag is corrupted.
        """
        try:
            message = self._typestore.deserialize_cdr(raw.cdr, raw.type_name)
        except Exception as error:  # rosbags' decoders have no common error
            raise _corrupted(self.path, error) from error
        return BagMessage(raw.topic, raw.type_name, raw.stamp_ns, message)

    def raw_messages(
        self, topics: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Yield the messages of these topics as they were recorded, in the order of their stamps.

        Args:
            topics: their names.
            start_ns: leave out what is earlier.
            stop_ns: leave out this and what is later.

        Raises:
            BagError: the bag is corrupted, or holds less than it says.
        """
        wanted = set(topics)
        single = self._metadata.compression_mode == "message"
        counted: Counter[str] = Counter()
        found = heapq.merge(
            *(source.messages(wanted, start_ns, stop_ns) for source in self._sources), key=lambda raw: raw.stamp_ns
        )
        while True:
            try:
                raw = next(found, None)
                if raw is not None and single:
                    raw = raw._replace(cdr=unpacked_message(raw.cdr))
            # The libraries' errors have no common base.
            except Exception as error:
                raise _corrupted(self.path, error) from error
            if raw is None:
                break
            counted[raw.topic] += 1
            yield raw
        if (start_ns is None or start_ns <= self.start_ns) and (stop_ns is None or stop_ns > self.end_ns):
            self._check_complete(wanted, counted)

    def _check_complete(self, wanted: Collection[str], counted: Counter[str]) -> None:
        for topic in self.contents:
            if topic.name in wanted and counted[topic.name] < topic.message_count:
                raise BagError(
                    f"{self.path} says that it holds {topic.message_count} messages on '{topic.name}', but only "
                    f"{counted[topic.name]} can be read; 'formation recover' saves what is whole"
                )

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
    into a temporary folder, which is removed when the bag is closed. So is one whose files were compressed as a whole.
    What is wrong with a bag that can be read is logged, once each.

    Args:
        path: the bag.
        allow_empty: whether a bag without messages is one.

    Raises:
        BagError: the path is missing, not a bag, empty or corrupted.
    """
    asked = Path(path)
    stack = ExitStack()
    try:
        found = readable(asked, stack)
        sources: list[Source] = []
        for file in found.files:
            source: Source = McapSource(file) if storage_of(file) == ".mcap" else SqliteSource(file)
            stack.callback(source.close)
            sources.append(source)
        bag = Bag(asked, sources, found.metadata, stack, recovered=found.recovered)
        if bag.message_count == 0 and not allow_empty:
            raise BagError(f"{asked} is empty: it holds no messages")
    except Exception as error:  # rosbags, mcap and SQLite have no common error
        stack.close()
        raise _corrupted(asked, error) from error
    except BaseException:
        stack.close()
        raise
    for warning in bag.warnings:
        _LOG.warning("warning: %s", warning)
    return bag


def _typestore(sources: Sequence[Source]) -> Any:
    """Collect the definitions of a bag's message types; those of Jazzy, if it has none."""
    definitions = {name: found for source in sources for name, found in source.definitions.items()}
    if not definitions:
        return jazzy_typestore()
    store = get_typestore(Stores.EMPTY)
    types: dict[str, Any] = {}
    for name, (encoding, text) in definitions.items():
        if encoding == "ros2msg":
            types.update(get_types_from_msg(text, name))
        elif encoding in ("ros2idl", "omgidl"):
            # Several files in one text, each below a line that names it; or a single one.
            parts = [part.partition("\n")[2] for part in text.split(_IDL_FILE)[1:]]
            for part in parts or [text]:
                types.update(get_types_from_idl(part))
        else:
            raise BagError(f"the definition of {shown(name)} is written in {shown(encoding)}, which can't be read")
    store.register(types)
    return store


def _merged(sources: Sequence[Source], metadata: FolderMetadata) -> list[TopicSummary]:
    """Add up the channels of a bag's files by topic."""
    found: dict[str, TopicSummary] = {}
    for channel in sorted((channel for source in sources for channel in source.channels), key=lambda c: c.name):
        type_hash = channel.type_hash or metadata.type_hashes.get(channel.name, "")
        new = TopicSummary(channel.name, channel.type_name, type_hash, channel.profiles, channel.message_count)
        known = found.setdefault(channel.name, new)
        if known is not new:  # one channel per file, or per publisher
            known.message_count += new.message_count
            known.profiles += tuple(profile for profile in new.profiles if profile not in known.profiles)
            if new.type_name not in known.type_name.split(" and "):
                known.type_name += f" and {new.type_name}"  # what `require` refuses
    return list(found.values())


def _differences(path: Path, metadata: FolderMetadata, contents: Sequence[TopicSummary]) -> list[str]:
    """Warn if a folder's metadata count other messages than its files hold."""
    there = {topic.name: topic.message_count for topic in contents}
    names = [name for name in {**metadata.counts, **there} if metadata.counts.get(name, 0) != there.get(name, 0)]
    if not names:
        return []
    return [
        f"{path}: metadata.yaml counts {metadata.counts.get(names[0], 0)} messages on '{names[0]}', the bag's files "
        f"hold {there.get(names[0], 0)} (topics that differ: {len(names)}); 'ros2 bag reindex' counts them anew"
    ]


def _corrupted(path: Path, error: Exception) -> BagError:
    if isinstance(error, BagError) and str(error).startswith(str(path)):
        return error
    if isinstance(error, OSError) and error.strerror:
        return BagError(f"{path} can't be read: {error.filename or path}: {error.strerror}")
    reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    return BagError(f"{path} can't be read: {reason}; it may be damaged, or no bag")
