"""What all messages share: serialisation, time, header; and the simplest messages."""

from __future__ import annotations

import importlib
import struct
from collections.abc import Mapping
from functools import cache
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String, UInt32

from robot_formation.names import Message
from robot_formation.system.cdr import HEAD

_NS = 1_000_000_000
_CLOCK = struct.Struct("<4siI")


@cache
def message_class(type_name: str) -> type[Message]:
    """Import the class of 'package/msg/Name'."""
    package, _, name = type_name.split("/")
    found: type[Message] = getattr(importlib.import_module(f"{package}.msg"), name)
    return found


def to_cdr(message: Message) -> bytes:
    """Serialise a message as it goes over the wire and into a bag; one that is serialised already stays as it is."""
    return message if isinstance(message, bytes) else serialize_message(message)  # type: ignore[no-any-return]


def from_cdr(data: bytes, type_name: str) -> Message:
    """Deserialise a message of 'package/msg/Name'."""
    return deserialize_message(data, message_class(type_name))


def as_message(message: Message, type_name: str) -> Message:
    """Return a message of 'package/msg/Name' that may be serialised, as an object."""
    return from_cdr(message, type_name) if isinstance(message, bytes) else message


def to_time(stamp_ns: int) -> Time:
    """Convert integer nanoseconds to a ROS time."""
    time = Time()
    _set_time(time, stamp_ns)
    return time


def to_ns(time: Time) -> int:
    """Convert a ROS time to integer nanoseconds."""
    return int(time.sec) * _NS + int(time.nanosec)


def header(stamp_ns: int, frame: str = "") -> Header:
    """Make a header."""
    made = Header()
    _set_time(made.stamp, stamp_ns)
    made.frame_id = frame
    return made


def stamped(kind: type[Message], stamp_ns: int, frame: str = "", **fields: Any) -> Message:
    """Make a message of a kind with a header.

    Generated classes make every message that they hold before they look whether another one was given: filling in their
    own header costs half of making one for them.
    """
    message = kind(**fields)
    _set_time(message.header.stamp, stamp_ns)
    message.header.frame_id = frame
    return message


def _set_time(time: Time, stamp_ns: int) -> None:
    time.sec, time.nanosec = divmod(stamp_ns, _NS)


def stamp_of(message: Message) -> int:
    """Read a stamped message's time in nanoseconds."""
    return to_ns(message.header.stamp)


def clock(stamp_ns: int) -> bytes:
    """Make a /clock message, serialised.

    A third of a run's messages are of this kind, mostly for a recorder alone. Filling in and serialising one of rclpy's
    takes nine times as long.
    """
    return _CLOCK.pack(HEAD, *divmod(stamp_ns, _NS))


def read_clock(message: Clock) -> int:
    """Return a /clock message's time, nanoseconds."""
    return to_ns(message.clock)


def uint32(value: int) -> UInt32:
    """Make a tick or a count."""
    return UInt32(data=value)


def string(text: str) -> String:
    """Make a text."""
    return String(data=text)


def diagnostics(name: str, level: int, text: str, values: Mapping[str, str], stamp_ns: int) -> DiagnosticArray:
    """Make a health report: level 0 OK, 1 warning, 2 error."""
    status = DiagnosticStatus(
        level=bytes([level]),
        name=name,
        message=text,
        hardware_id="robot_formation",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    return stamped(DiagnosticArray, stamp_ns, status=[status])
