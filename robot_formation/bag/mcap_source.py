"""Reading one finished MCAP file by its index. Only as much is unpacked at a time as the order of stamps needs."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from robot_formation.bag.errors import BagError
from robot_formation.bag.mcap_chunks import chunk_messages
from robot_formation.bag.mcap_records import MAGIC, records, summary_place
from robot_formation.bag.metadata import TopicSummary
from robot_formation.bag.qos import TopicQos, parse_profiles
from robot_formation.bag.source import RawMessage, Source
from robot_formation.errors import shown
from robot_formation.system.files import open_file

_FOREVER_NS = 2**64

# Stamp, and what keeps the order of equal ones: the chunk's place in the file, and the message's in the chunk.
_Place = tuple[int, int, int]


class McapSource(Source):
    """See `Source`.

    Raises:
        BagError: the file is no MCAP file of ROS 2, or a part of it is wrong.
        Exception: of the library, which has no common base, if the file is damaged.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.warnings: list[str] = []
        self._stream = open_file(path)
        try:
            self._open()
        except BaseException:
            self._stream.close()
            raise

    def _open(self) -> None:
        magic = self._stream.read(len(MAGIC))
        if magic != MAGIC:
            raise BagError("the file seems to be empty" if not magic else "the file is no MCAP file")
        header = next(records(self._stream, len(MAGIC)), None)
        profile = header.profile if isinstance(header, Header) else ""
        if profile != "ros2":
            raise BagError(f"the MCAP file's profile is {shown(profile)}, not that of ROS 2")
        found = _summary(self._stream)
        counts = next(iter(found[Statistics]), None)
        if counts is None:
            raise BagError("the MCAP file has no index")
        self.message_count = counts.message_count
        self.start_ns, self.end_ns = counts.message_start_time, counts.message_end_time
        self._chunks = sorted(found[ChunkIndex], key=lambda index: (index.message_start_time, index.chunk_start_offset))
        self.compressions = frozenset(index.compression or "none" for index in self._chunks)
        schemas = {schema.id: schema for schema in found[Schema]}
        self._take_channels(found[Channel], schemas, counts.channel_message_counts)
        self.records = []
        for index in found[MetadataIndex]:
            record = next(records(self._stream, index.offset), None)
            if isinstance(record, Metadata):
                self.records.append((record.name, dict(record.metadata)))

    def _take_channels(
        self, channels: Sequence[Channel], schemas: Mapping[int, Schema], counts: Mapping[int, int]
    ) -> None:
        self.definitions: dict[str, tuple[str, str]] = {}
        self.channels: list[TopicSummary] = []
        self._names: dict[int, tuple[str, str]] = {}
        for channel in channels:
            if channel.message_encoding != "cdr":
                encoding = shown(channel.message_encoding)
                raise BagError(f"{shown(channel.topic)} holds messages encoded as {encoding}, not as CDR")
            schema = schemas.get(channel.schema_id)
            type_name = schema.name if schema else ""
            if schema is not None and schema.encoding:
                self.definitions.setdefault(schema.name, (schema.encoding, str(schema.data, "utf-8")))
            self._names[channel.id] = (channel.topic, type_name)
            self.channels.append(
                TopicSummary(
                    channel.topic,
                    type_name,
                    channel.metadata.get("topic_type_hash", ""),
                    self._profiles(channel),
                    counts.get(channel.id, 0),
                )
            )

    def _profiles(self, channel: Channel) -> tuple[TopicQos, ...]:
        try:
            return parse_profiles(channel.metadata.get("offered_qos_profiles", ""))
        except BagError as error:
            self.warnings.append(f"{shown(channel.topic)}: {error}")
            return ()

    def messages(self, topics: Collection[str], start_ns: int | None, stop_ns: int | None) -> Iterator[RawMessage]:
        """See `Source`.

        Raises:
            BagError: a chunk is damaged.
        """
        wanted = {number: names for number, names in self._names.items() if names[0] in topics}
        start, stop = start_ns or 0, _FOREVER_NS if stop_ns is None else stop_ns
        if not self._chunks:
            yield from self._loose_messages(wanted, start, stop)
            return
        chosen = [
            self._of_chunk(index, wanted, start, stop)
            for index in self._chunks
            if index.message_end_time >= start and index.message_start_time < stop and self._may_hold(index, wanted)
        ]
        for _, message in heapq.merge(*chosen, key=lambda item: item[0]):
            if message is not None:
                yield message

    @staticmethod
    def _may_hold(index: ChunkIndex, wanted: Collection[int]) -> bool:
        offsets = index.message_index_offsets
        return not offsets or any(number in offsets for number in wanted)

    def _of_chunk(
        self, index: ChunkIndex, wanted: dict[int, tuple[str, str]], start: int, stop: int
    ) -> Iterator[tuple[_Place, RawMessage | None]]:
        """Yield a chunk's messages by their stamps; before it is unpacked, where it begins."""
        offset = index.chunk_start_offset
        yield (index.message_start_time, offset, -1), None
        found = [
            ((stamp_ns, offset, number), RawMessage(*wanted[channel], stamp_ns, data))
            for number, (channel, stamp_ns, data) in enumerate(chunk_messages(self._chunk(index)))
            if channel in wanted and start <= stamp_ns < stop
        ]
        yield from sorted(found, key=lambda item: item[0])

    def _chunk(self, index: ChunkIndex) -> Chunk:
        found = next(records(self._stream, index.chunk_start_offset), None)
        if not isinstance(found, Chunk):
            raise BagError("the index names a chunk where there is none")
        return found

    def _loose_messages(self, wanted: dict[int, tuple[str, str]], start: int, stop: int) -> Iterator[RawMessage]:
        """Yield the messages of a file without chunks, which must lie in the order of their stamps."""
        last_ns = 0
        with open_file(self._path) as stream:
            for record in records(stream, len(MAGIC)):
                if isinstance(record, DataEnd):
                    return
                if not isinstance(record, Message) or record.channel_id not in wanted:
                    continue
                if record.log_time < last_ns:
                    raise BagError("messages are not in the order of time, and no chunks are there to sort them by")
                last_ns = record.log_time
                if start <= last_ns < stop:
                    yield RawMessage(*wanted[record.channel_id], last_ns, record.data)

    def close(self) -> None:
        """Close the file."""
        self._stream.close()


def has_index(path: Path) -> bool:
    """Return whether an MCAP file has what `McapSource` needs; a damaged one has, for its damage has to be told."""
    with open_file(path) as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            return True
        try:
            return bool(_summary(stream)[Statistics])
        except Exception:  # of the library, which has no common base
            return True


def _summary(stream: BinaryIO) -> dict[type, list[Any]]:
    """Read a file's summary: records by kind."""
    found: dict[type, list[object]] = defaultdict(list)
    place = summary_place(stream)
    for record in records(stream, place) if place else ():
        if isinstance(record, Footer):
            break
        found[type(record)].append(record)
    return found
