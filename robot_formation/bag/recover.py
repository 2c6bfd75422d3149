"""Make a complete bag of one whose writer was killed."""

from __future__ import annotations

import fcntl
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, DataEnd, Header, Message, Metadata, Schema

from robot_formation.bag.definitions import Definition
from robot_formation.bag.errors import BagError
from robot_formation.bag.mcap_chunks import chunk_records
from robot_formation.bag.mcap_records import MAGIC, records
from robot_formation.bag.metadata import Span
from robot_formation.bag.qos import TopicQos, parse_profiles
from robot_formation.bag.writer import BagWriter
from robot_formation.errors import shown
from robot_formation.system.files import open_file

RECOVERING_SUFFIX = ".recovering"
"""What the new bag's folder is called behind its name while the old one is being copied into it."""


@dataclass(frozen=True)
class RecoverReport:
    """What `recover` saved.

    Attributes:
        path: the new bag.
        messages: messages saved.
        message_counts: the same by topic.
        first_stamp_ns: log time of the earliest message saved, nanoseconds.
        last_stamp_ns: log time of the latest message saved, nanoseconds.
        complete: the old bag's data section had its end, so nothing is missing behind it.
        damaged_chunks: chunks inside the file that failed their checksum and were left out.
        lost_bytes: size of the unreadable tail.
    """

    path: Path
    messages: int
    message_counts: dict[str, int]
    first_stamp_ns: int
    last_stamp_ns: int
    complete: bool
    damaged_chunks: int
    lost_bytes: int


def recover(partial_path: str | Path, out_path: str | Path) -> RecoverReport:
    """Stream what can be read out of an unclosed bag into a complete one; the old bag stays as it is.

    Args:
        partial_path: the bag's folder (`<path>.partial`, or any folder with MCAP files), or one MCAP file.
        out_path: the new bag's folder.

    Raises:
        BagError: there is no such bag, it isn't MCAP with profile ros2, no message can be
            read from it, or the new bag's path is taken or can't be written.
    """
    source = Path(partial_path)
    copy = _Copy(source, Path(out_path))
    try:
        for file in mcap_files(source):
            copy.read(file)
        if copy.writer is not None:
            copy.writer.close()
    except BaseException as error:
        if copy.writer is not None:
            copy.writer.discard()
        if isinstance(error, OSError):
            raise BagError(f"{source} can't be read: {error.strerror or error}") from error
        raise
    if copy.writer is None:
        raise BagError(
            f"{source} holds no message that can be read; its writer ended before the first chunk was closed"
        )
    return RecoverReport(
        path=copy.writer.path,
        messages=copy.writer.message_count,
        message_counts=copy.writer.message_counts,
        first_stamp_ns=copy.span.first_ns,
        last_stamp_ns=copy.span.last_ns,
        complete=copy.complete,
        damaged_chunks=copy.damaged_chunks,
        lost_bytes=copy.lost_bytes,
    )


def mcap_files(path: Path) -> list[Path]:
    """List a bag's MCAP files in order.

    Raises:
        BagError: the path is missing, or holds no MCAP file.
    """
    if not path.exists():
        raise BagError(f"{path} doesn't exist; give a bag's folder or an .mcap file")
    files = sorted(path.glob("*.mcap"), key=in_order) if path.is_dir() else [path]
    if path.name.endswith(".zstd") or (not files and any(path.glob("*.zstd"))):
        raise BagError(f"{path} holds files that were compressed as a whole; unpack them with 'zstd -d' first")
    if not files or files[0].suffix != ".mcap":
        raise BagError(f"{path} is not a bag; give a folder that 'ros2 bag' or this project wrote, or an .mcap file")
    return files


def is_being_written(path: Path) -> bool:
    """Return whether a writer of this project has one of the bag's files open.

    Raises:
        BagError: as for `mcap_files`.
    """
    for file in mcap_files(path):
        with open_file(file) as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
            except OSError:  # a file system without locks
                return False
    return False


def in_order(path: Path) -> list[int | str]:
    """Return a sort key by which run_10.mcap comes after run_9.mcap."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)]


@dataclass
class _Copy:
    """Copies records of MCAP files into a new bag, which is made when the first message is there."""

    source: Path
    target: Path
    writer: BagWriter | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    waiting_metadata: list[Metadata] = field(default_factory=list)
    span: Span = field(default_factory=Span)
    complete: bool = True
    damaged_chunks: int = 0
    lost_bytes: int = 0

    def read(self, file: Path) -> None:
        """Copy one file up to its end or to the first record that is cut off."""
        self.schemas.clear()
        self.channels.clear()
        with open_file(file) as stream:
            readable = 0
            finished = False
            for record in _readable_records(stream):
                if isinstance(record, Header) and record.profile != "ros2":
                    raise BagError(f"{file} is an MCAP file of profile {shown(record.profile)}, not of ROS 2")
                self.take(record)
                readable = stream.tell()
                finished = isinstance(record, DataEnd)
            if readable == 0 and not _begins_as_mcap(file):
                raise BagError(f"{file} is not an MCAP file; there is nothing to recover")
        if not finished:
            self.complete = False
            self.lost_bytes += file.stat().st_size - readable

    def take(self, record: Any) -> None:
        if isinstance(record, Chunk):
            for inner in self.unpack(record):
                self.take(inner)
        elif isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record
        elif isinstance(record, Message):
            self.copy_message(record)
        elif isinstance(record, Metadata) and record.name != "rosbag2":
            self.waiting_metadata.append(record)
            self.flush_metadata()

    def unpack(self, chunk: Chunk) -> list[Any]:
        try:
            return chunk_records(chunk)
        # Besides MCAP's own errors the decompressors raise theirs, which have no common base.
        except Exception:
            self.damaged_chunks += 1
            return []

    def copy_message(self, message: Message) -> None:
        channel = self.channels.get(message.channel_id)
        schema = self.schemas.get(channel.schema_id) if channel else None
        # Without its definition (a damaged chunk) nobody could read the message.
        if channel is None or schema is None or channel.message_encoding != "cdr":
            return
        if self.writer is None:
            self.writer = BagWriter(self.target, partial_suffix=RECOVERING_SUFFIX)
            self.flush_metadata()
        if self.types.setdefault(channel.topic, schema.name) != schema.name:
            return
        if channel.topic not in self.writer.message_counts:
            try:
                text = schema.data.decode()
            except UnicodeDecodeError:
                return
            embedded = Definition(schema.name, schema.encoding, text, channel.metadata.get("topic_type_hash", ""))
            self.writer.add_topic(channel.topic, schema.name, _profiles(channel), embedded=embedded)
        self.writer.write(channel.topic, message.data, message.publish_time, log_time_ns=message.log_time)
        self.span.include(message.log_time)

    def flush_metadata(self) -> None:
        if self.writer is not None:
            for record in self.waiting_metadata:
                self.writer.write_metadata(record.name, record.metadata)
            self.waiting_metadata.clear()


def _profiles(channel: Channel) -> tuple[TopicQos, ...]:
    try:
        return parse_profiles(channel.metadata.get("offered_qos_profiles", ""))
    except BagError:  # the messages are worth more
        return ()


def _readable_records(stream: Any) -> Iterator[object]:
    """Yield a file's records, whole ones only, up to the end of its data section or of what is there."""
    try:
        if stream.read(len(MAGIC)) != MAGIC:
            return
        for record in records(stream, len(MAGIC)):
            yield record
            if isinstance(record, DataEnd):
                return
    # A cut-off or overwritten record shows as an end of file, a short field, an absurd length or a broken text.
    except (McapError, struct.error, ValueError, MemoryError, OverflowError):
        return


def _begins_as_mcap(file: Path) -> bool:
    """Whether a file begins as MCAP, as far as it goes: the last one of a split bag may be empty."""
    with open_file(file) as stream:
        return MAGIC.startswith(stream.read(len(MAGIC)))
