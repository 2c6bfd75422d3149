"""How a bag's files are written."""

from __future__ import annotations

from dataclasses import dataclass

CHUNK_BYTES = 1 << 20


@dataclass(frozen=True)
class WriteOptions:
    """How a bag's files are written.

    Attributes:
        compression: of the chunks: `zstd`, `lz4` or `none`.
        chunk_bytes: a chunk that holds so much is ended before the next message.
        split_bytes: a new file is begun when the present one is larger; 0: never.
        split_ns: a new file is begun when the log times in the present one span more, nanoseconds; 0: never.
    """

    compression: str = "zstd"
    chunk_bytes: int = CHUNK_BYTES
    split_bytes: int = 0
    split_ns: int = 0


DEFAULT_OPTIONS = WriteOptions()
