"""One MCAP file of a bag: profile ros2, CDR, embedded definitions, chunks that survive the death of their writer."""

from __future__ import annotations

import contextlib
import fcntl
from collections.abc import Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

from robot_formation.bag.definitions import Definition
from robot_formation.bag.metadata import Span, TopicSummary
from robot_formation.bag.qos import TopicQos, dump_profiles

COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
_MESSAGE_OVERHEAD_BYTES = 31  # opcode, length, channel, sequence and two times of a message record
_NEVER_BYTES = 1 << 62


class McapFile:
    """Writes one file; its methods raise OSError when the disk does.

    Only `end_chunk` ends a chunk; `open_bytes` is the size of the one that is not ended yet. The file is locked (flock)
    while it is open, so that others can tell a bag that is being written from one whose writer is dead.

    Args:
        path: the file, which must not exist.
        compression: a key of `COMPRESSIONS`.
    """

    def __init__(self, path: Path, *, compression: str) -> None:
        self.path = path
        self.open_bytes = 0
        self.message_count = 0
        self.span = Span()
        self.summaries: dict[str, TopicSummary] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._stream = path.open("xb")
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # Chunks are ended here only, since the library's own ends stay in Python's buffer for a while.
        self._mcap = Writer(self._stream, compression=COMPRESSIONS[compression], chunk_size=_NEVER_BYTES)
        self._mcap.start(profile="ros2")
        self._stream.flush()

    @property
    def bytes_written(self) -> int:
        """Size of the file so far; the open chunk doesn't count."""
        return self._stream.tell()

    def add_topic(self, name: str, what: Definition, profiles: tuple[TopicQos, ...]) -> None:
        """Declare a topic."""
        if what.type_name not in self._schemas:
            text = what.text.encode()
            self._schemas[what.type_name] = self._mcap.register_schema(what.type_name, what.encoding, text)
        metadata = {"offered_qos_profiles": dump_profiles(profiles), "topic_type_hash": what.type_hash}
        self._channels[name] = self._mcap.register_channel(name, "cdr", self._schemas[what.type_name], metadata)
        self.summaries[name] = TopicSummary(name, what.type_name, what.type_hash, profiles)

    def write(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int) -> None:
        """Append a message of a declared topic."""
        summary = self.summaries[topic]
        self._mcap.add_message(self._channels[topic], log_time_ns, cdr, publish_time_ns, summary.message_count)
        self.open_bytes += len(cdr) + _MESSAGE_OVERHEAD_BYTES
        summary.message_count += 1
        self.message_count += 1
        self.span.include(log_time_ns)

    def end_chunk(self) -> None:
        """Close the chunk and hand it to the operating system."""
        self._mcap.flush()
        self.open_bytes = 0

    def write_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record at this place."""
        self._mcap.add_metadata(name, dict(values))
        self._stream.flush()

    def finish(self) -> None:
        """Write index and footer and close the file."""
        with self._stream:
            self._mcap.finish()

    def abandon(self) -> None:
        """Close the file as it is: what the disk has not taken is lost."""
        with contextlib.suppress(OSError):
            self._stream.close()
