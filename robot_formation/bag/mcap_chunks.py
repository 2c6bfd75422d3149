"""Unpacking what is compressed in bags, never to more than it says or than memory holds.

The decompressors themselves believe a frame that promises gigabytes.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace

import lz4.frame
import zstandard
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import breakup_chunk

from robot_formation.bag.errors import BagError
from robot_formation.errors import shown
from robot_formation.system.files import size_text

MOST_BYTES = 128 << 20
"""Size of the largest chunk or message that is unpacked; recorders make chunks of 1 to 4 MiB."""

_MESSAGE = 5
_RECORD = struct.Struct("<BQ")  # kind, length
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


def unpacked(data: bytes, compression: str, size: int) -> bytes:
    """Unpack a chunk's data.

    Args:
        data: the compressed bytes.
        compression: `zstd`, `lz4` or nothing.
        size: what the chunk says it has unpacked.

    Raises:
        BagError: the size is beyond the bound, isn't met, or the data are damaged.
    """
    if size > MOST_BYTES:
        raise BagError(f"a chunk says that it holds {size_text(size)} unpacked, more than {size_text(MOST_BYTES)}")
    if compression == "zstd":
        raw = _zstd(data, size)
    elif compression == "lz4":
        try:
            raw = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
        except RuntimeError as error:
            raise BagError(f"a chunk is damaged: {error}") from error
    elif not compression:
        raw = data
    else:
        raise BagError(f"a chunk is compressed as {shown(compression)}, which can't be read; there are zstd and lz4")
    if len(raw) != size:
        raise BagError(f"a chunk is damaged: it holds another number of bytes than the {size} that it says")
    return raw


def unpacked_message(data: bytes) -> bytes:
    """Unpack a message of a bag whose messages were compressed one by one, with zstd.

    Raises:
        BagError: its size is beyond the bound, or it is damaged.
    """
    return _zstd(data, None)


def _zstd(data: bytes, size: int | None) -> bytes:
    try:
        said = zstandard.frame_content_size(data)
        if said > (MOST_BYTES if size is None else size):
            raise BagError(f"compressed data say that they hold {size_text(said)}, more than they may")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=MOST_BYTES if size is None else size)
    except zstandard.ZstdError as error:
        raise BagError(f"compressed data are damaged: {error}") from error


def chunk_records(chunk: Chunk) -> list[McapRecord]:
    """List the records in a chunk.

    Raises:
        BagError: it can't be unpacked.
        Exception: of the library, which has no common base, if its contents are damaged.
    """
    raw = unpacked(chunk.data, chunk.compression, chunk.uncompressed_size)
    records: list[McapRecord] = breakup_chunk(replace(chunk, compression="", data=raw), validate_crc=True)
    return records


def chunk_messages(chunk: Chunk) -> Iterator[tuple[int, int, bytes]]:
    """Yield channel number, log time [ns] and data of a chunk's messages, in their order.

    Raises:
        BagError: it is damaged.
    """
    raw = unpacked(chunk.data, chunk.compression, chunk.uncompressed_size)
    if chunk.uncompressed_crc and zlib.crc32(raw) != chunk.uncompressed_crc:
        raise BagError("a chunk is damaged: its check sum is another one")
    at, end = 0, len(raw)
    while at < end:
        if end - at < _RECORD.size:
            raise BagError("a chunk is damaged: it ends within a record")
        kind, length = _RECORD.unpack_from(raw, at)
        at += _RECORD.size
        if length > end - at or (kind == _MESSAGE and length < _MESSAGE_HEAD.size):
            raise BagError(f"a chunk is damaged: a record in it says that it has {size_text(length)}")
        if kind == _MESSAGE:
            channel, _, log_time_ns, _ = _MESSAGE_HEAD.unpack_from(raw, at)
            yield channel, log_time_ns, raw[at + _MESSAGE_HEAD.size : at + length]
        at += length
