"""What every storage file of a bag offers, whichever its format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from robot_formation.bag.metadata import TopicSummary


class RawMessage(NamedTuple):
    """One message as it was recorded: topic, type, the bag's stamp (log time, nanoseconds), and its CDR."""

    topic: str
    type_name: str
    stamp_ns: int
    cdr: bytes


class Source(ABC):
    """An open storage file.

    Attributes:
        channels: its topics with their numbers of messages; a topic may have several.
        definitions: encoding (`ros2msg`, `ros2idl`) and text of its message types, by name; without those it lacks.
        message_count: messages in it.
        start_ns: stamp of the first message, if there is one.
        end_ns: stamp of the last message, if there is one.
        compressions: how its chunks are compressed.
        records: name and texts of its metadata records, in their order.
        warnings: what can't be read in it, though its messages can.
    """

    channels: Sequence[TopicSummary]
    definitions: Mapping[str, tuple[str, str]]
    message_count: int
    start_ns: int
    end_ns: int
    compressions: frozenset[str]
    records: Sequence[tuple[str, dict[str, str]]]
    warnings: Sequence[str]

    @abstractmethod
    def messages(self, topics: Collection[str], start_ns: int | None, stop_ns: int | None) -> Iterator[RawMessage]:
        """Yield the messages of these topics with stamps from `start_ns` on and before `stop_ns`, in their order."""

    @abstractmethod
    def close(self) -> None:
        """Close the file."""
