"""Reading one SQLite file of a bag, through rosbags."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from rosbags.interfaces import ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import Reader

from robot_formation.bag.errors import BagError
from robot_formation.bag.metadata import TopicSummary
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.source import RawMessage, Source
from robot_formation.errors import shown
from robot_formation.json_values import Json
from robot_formation.system.files import check_file

_ENCODINGS = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}


class SqliteSource(Source):
    """See `Source`.

    Raises:
        BagError: a table holds values of other types.
        Exception: of rosbags or SQLite, which have no common base, if the file is damaged.
    """

    compressions = frozenset()
    records = ()
    warnings = ()

    def __init__(self, path: Path) -> None:
        check_file(path)
        self._reader = Reader(path)
        self._reader.open()
        try:
            connections = self._reader.connections
            for connection in connections:
                _check(connection.topic, str, "a topic's name")
                _check(connection.msgtype, str, "a topic's type")
                _check(connection.msgcount, int, "a number of messages")
            self.channels = [
                TopicSummary(
                    connection.topic,
                    connection.msgtype,
                    str(connection.digest or ""),
                    tuple(_qos(profile) for profile in connection.ext.offered_qos_profiles),
                    connection.msgcount,
                )
                for connection in connections
                if isinstance(connection.ext, ConnectionExtRosbag2)  # always: it is no ROS 1 bag
            ]
            self.definitions = {
                connection.msgtype: (_ENCODINGS[connection.msgdef.format], connection.msgdef.data)
                for connection in connections
                if connection.msgdef.format in _ENCODINGS
            }
            self.message_count = _check(self._reader.message_count, int, "a number of messages")
            self.start_ns = _check(self._reader.start_time, int, "a time")
            self.end_ns = _check(self._reader.end_time, int, "a time") - 1
        except BaseException:
            self._reader.close()
            raise

    def messages(self, topics: Collection[str], start_ns: int | None, stop_ns: int | None) -> Iterator[RawMessage]:
        """See `Source`.

        Raises:
            BagError: a message or its time is of another type.
        """
        wanted = [connection for connection in self._reader.connections if connection.topic in topics]
        if not wanted:
            return
        for connection, stamp_ns, data in self._reader.messages(wanted, start=start_ns, stop=stop_ns):
            _check(stamp_ns, int, "a time")
            yield RawMessage(connection.topic, connection.msgtype, stamp_ns, _check(data, bytes, "a message"))

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


def _check(value: object, kind: type, what: str) -> Json:
    """Refuse what SQLite lets into any column."""
    if not isinstance(value, kind):
        raise BagError(f"{what} in the database is {shown(value)}")
    return value


def _qos(profile: Json) -> TopicQos:
    """Convert rosbags' profile."""
    times = (profile.deadline, profile.lifespan, profile.liveliness_lease_duration)
    deadline_ns, lifespan_ns, lease_ns = (time.sec * 10**9 + time.nsec for time in times)
    return TopicQos(
        profile.history.name.lower(),
        max(0, profile.depth),
        profile.reliability.name.lower(),
        profile.durability.name.lower(),
        deadline_ns,
        lifespan_ns,
        "unknown" if profile.liveliness.name == "MANUAL_BY_NODE" else profile.liveliness.name.lower(),
        lease_ns,
        profile.avoid_ros_namespace_conventions,
    )
