"""What a PNG file says of itself, before anything of it is decoded (PNG specification, third edition)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEAD = struct.Struct(">8x4x4sIIBB")  # signature, length, "IHDR", width, height, bit depth, colour type
_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type
_STEP = 1 << 20


class PngHead(NamedTuple):
    """Width and height in pixels, bits per sample, and PNG's number of the colour type (0: grey)."""

    width: int
    height: int
    depth: int
    colour: int

    @property
    def data_bytes(self) -> int:
        """Upper bound of the size of the pixels before they are packed: rows with their filters, interlaced too."""
        row = (self.width * self.depth * _SAMPLES.get(self.colour, 4) + 7) // 8 + 1
        return 2 * row * self.height + 8192


def png_head(content: bytes) -> PngHead | None:
    """Read a file's first chunk; None if it isn't there."""
    if not content.startswith(SIGNATURE) or len(content) < _HEAD.size:
        return None
    kind, width, height, depth, colour = _HEAD.unpack_from(content)
    return PngHead(width, height, depth, colour) if kind == b"IHDR" else None


def is_whole(content: bytes) -> bool:
    """Return whether all chunks are there and have their check sums; OpenCV would fill what is missing with black."""
    kind = b""
    for kind, data, check_sum in _chunks(content):
        if zlib.crc32(data, zlib.crc32(kind)) != check_sum:
            return False
    return kind == b"IEND"


def unpacks_within(content: bytes, most_bytes: int) -> bool:
    """Return whether the pixels unpack to no more than so many bytes; what a library would work through in vain."""
    unpacker = zlib.decompressobj()
    size = 0
    for kind, data, _ in _chunks(content):
        if kind != b"IDAT":
            continue
        rest = bytes(data)
        try:
            while rest and not unpacker.eof:
                size += len(unpacker.decompress(rest, _STEP))
                rest = unpacker.unconsumed_tail
                if size > most_bytes:
                    return False
        except zlib.error:  # damaged: the decoder stops there as well
            return True
    return True


def _chunks(content: bytes) -> Iterator[tuple[bytes, memoryview, int]]:
    """Yield kind, data and check sum of the whole chunks up to the end or the last one."""
    view = memoryview(content)
    at = len(SIGNATURE)
    while len(content) >= at + 12:
        end = at + 8 + int.from_bytes(content[at : at + 4], "big")
        if len(content) < end + 4:
            return
        kind = content[at + 4 : at + 8]
        yield kind, view[at + 8 : end], int.from_bytes(content[end : end + 4], "big")
        if kind == b"IEND":
            return
        at = end + 4
