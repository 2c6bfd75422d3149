"""The records of an MCAP file, one after the other. Nothing larger than the file or the bound is asked for."""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

from mcap import records as kinds
from mcap.data_stream import ReadDataStream

from robot_formation.bag.errors import BagError
from robot_formation.system.files import size_text

MAGIC = b"\x89MCAP0\r\n"
MOST_MCAP_RECORD_BYTES = 256 << 20
"""Size of the largest record that is read."""

_HEAD = struct.Struct("<BQ")  # kind, length
_FOOTER = struct.Struct("<BQQQI")  # kind, length, where the summary begins, where its offsets begin, check sum
_MESSAGE = 0x05
_KINDS: dict[int, Any] = {
    0x01: kinds.Header,
    0x02: kinds.Footer,
    0x03: kinds.Schema,
    0x04: kinds.Channel,
    _MESSAGE: kinds.Message,
    0x06: kinds.Chunk,
    0x07: kinds.MessageIndex,
    0x08: kinds.ChunkIndex,
    0x09: kinds.Attachment,
    0x0A: kinds.AttachmentIndex,
    0x0B: kinds.Statistics,
    0x0C: kinds.Metadata,
    0x0D: kinds.MetadataIndex,
    0x0E: kinds.SummaryOffset,
    0x0F: kinds.DataEnd,
}
_OTHERS = 0x80  # from here on records are those of applications, and skipped


def records(stream: BinaryIO, at: int) -> Iterator[object]:
    """Yield the records from a place in the file on, chunks as they are; the file stands behind each.

    Ends with the file.

    Raises:
        BagError: a record is no record, goes beyond the file's end or is larger than the bound.
        Exception: of the library, which has no common base, if a record's content is damaged.
    """
    size = os.fstat(stream.fileno()).st_size
    while at + _HEAD.size <= size:
        stream.seek(at)
        kind, length = _HEAD.unpack(stream.read(_HEAD.size))
        if kind not in _KINDS and kind < _OTHERS:  # zeros, where a file was cut off
            raise BagError(f"there is no record at byte {at}")
        at += _HEAD.size + length
        if at > size:
            raise BagError("a record goes beyond the file's end")
        if kind >= _OTHERS:
            continue
        if length > MOST_MCAP_RECORD_BYTES:
            raise BagError(f"a record has {size_text(length)}, more than {size_text(MOST_MCAP_RECORD_BYTES)}")
        content = ReadDataStream(io.BytesIO(stream.read(length)))
        yield kinds.Message.read(content, length) if kind == _MESSAGE else _KINDS[kind].read(content)


def summary_place(stream: BinaryIO) -> int:
    """Return where a file's summary begins; 0 if it has none, or no end.

    Raises:
        BagError: the end is no end of an MCAP file.
    """
    size = os.fstat(stream.fileno()).st_size
    if size < 2 * len(MAGIC) + _FOOTER.size:
        return 0
    stream.seek(size - len(MAGIC) - _FOOTER.size)
    kind, length, place, _, _ = _FOOTER.unpack(stream.read(_FOOTER.size))
    if stream.read(len(MAGIC)) != MAGIC:
        return 0
    if kind != 0x02 or length != _FOOTER.size - _HEAD.size or place > size:
        raise BagError("the file's end is damaged")
    return int(place)
