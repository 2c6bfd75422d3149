"""What all messages share: serialisation, time, header; and the simplest messages."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from functools import cache

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String, UInt32

from robot_formation.names import Message

_NS = 1_000_000_000


@cache
def message_class(type_name: str) -> type[Message]:
    """Import the class of 'package/msg/Name'."""
    package, _, name = type_name.split("/")
    found: type[Message] = getattr(importlib.import_module(f"{package}.msg"), name)
    return found


def to_cdr(message: Message) -> bytes:
    """Serialise a message as it goes over the wire and into a bag."""
    return serialize_message(message)  # type: ignore[no-any-return]


def from_cdr(data: bytes, type_name: str) -> Message:
    """Deserialise a message of 'package/msg/Name'."""
    return deserialize_message(data, message_class(type_name))


def to_time(stamp_ns: int) -> Time:
    """Convert integer nanoseconds to a ROS time."""
    return Time(sec=stamp_ns // _NS, nanosec=stamp_ns % _NS)


def to_ns(time: Time) -> int:
    """Convert a ROS time to integer nanoseconds."""
    return int(time.sec) * _NS + int(time.nanosec)


def header(stamp_ns: int, frame: str = "") -> Header:
    """Make a header."""
    return Header(stamp=to_time(stamp_ns), frame_id=frame)


def stamp_of(message: Message) -> int:
    """Read a stamped message's time in nanoseconds."""
    return to_ns(message.header.stamp)


def clock(stamp_ns: int) -> Clock:
    """Make a /clock message."""
    return Clock(clock=to_time(stamp_ns))


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
    return DiagnosticArray(header=header(stamp_ns), status=[status])
