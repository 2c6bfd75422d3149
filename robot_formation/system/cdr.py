"""What messages are made of when they are serialised without a library: numbers and texts, plain CDR of version 1.

Numbers lie at multiples of their size, counted from behind a head of four bytes; a text has its length before it and a
zero byte behind it.
"""

from __future__ import annotations

import struct

HEAD = bytes((0, 1, 0, 0))
"""Of a message whose numbers have their low byte first."""
_ORDERS = {bytes((0, 0)): ">", bytes((0, 1)): "<"}


def gap(place: int, size: int) -> int:
    """How many bytes follow a place in a message until numbers of a size may begin."""
    return -(place - len(HEAD)) % size


def add_numbers(cdr: bytearray, size: int, data: bytes) -> None:
    """Add numbers of a size in bytes to a message that begins with `HEAD`."""
    cdr += bytes(gap(len(cdr), size)) + data


def add_text(cdr: bytearray, text: str) -> None:
    """Add a text to a message that begins with `HEAD`."""
    data = text.encode() + b"\0"
    add_numbers(cdr, 4, struct.pack("<I", len(data)) + data)


def byte_order(cdr: bytes) -> str:
    """Return a message's byte order as `struct` names it.

    Raises:
        ValueError: it is too short for a message, or serialised in another way.
    """
    order = _ORDERS.get(bytes(cdr[:2]))
    if order is None or len(cdr) < len(HEAD):
        raise ValueError("the message is no plain CDR")
    return order


def read_text(cdr: bytes, start: int) -> tuple[str, int]:
    """Read a text that begins at or behind a place; return it and where it ends.

    Raises:
        ValueError: there is none.
    """
    start += gap(start, 4)
    if start + 4 > len(cdr):
        raise ValueError("the message ends before a text")
    (length,) = struct.unpack_from(byte_order(cdr) + "I", cdr, start)
    end = start + 4 + length
    if length == 0 or end > len(cdr) or cdr[end - 1]:
        raise ValueError("the message holds a text without an end")
    return cdr[start + 4 : end - 1].decode(), end
