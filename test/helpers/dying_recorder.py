"""What a recorder that dies on a topic of counting numbers has written: read by MCAP's specification, and as a bag."""

import resource
import struct
from collections.abc import Iterator
from pathlib import Path

import zstandard

from robot_formation.bag.reader import read_bag

MAGIC_BYTES, CHUNK, MESSAGE = 8, 0x06, 0x05


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and body of each whole MCAP record, by the specification."""
    place = 0
    while place + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, place)
        if place + 9 + length > len(data):
            return
        yield opcode, data[place + 9 : place + 9 + length]
        place += 9 + length


def ticks_in_finished_chunks(file: Path) -> list[int]:
    found = []
    for opcode, body in records(file.read_bytes()[MAGIC_BYTES:]):
        if opcode == CHUNK:
            (name_length,) = struct.unpack_from("<I", body, 28)
            inner = zstandard.decompress(body[32 + name_length + 8 :])
            found += [int.from_bytes(b[26:30], "little") for kind, b in records(inner) if kind == MESSAGE]
    return found


def ticks_of(bag: Path) -> list[int]:
    with read_bag(bag) as opened:
        return [message.message.data for message in opened.messages(["/tick"])]


def limit_file_size() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))
