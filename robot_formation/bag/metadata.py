"""rosbag2's metadata, version 9: the contents of `metadata.yaml` and of the MCAP record `rosbag2`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from robot_formation.bag.qos import TopicQos

VERSION = 9
ROS_DISTRO = "jazzy"
_NO_MESSAGE_NS = 2**63 - 1  # rosbag2's starting time of an empty bag (time_point::max)


@dataclass
class TopicSummary:
    """What the metadata say about a topic."""

    name: str
    type_name: str
    type_hash: str
    profiles: tuple[TopicQos, ...]
    message_count: int = 0


@dataclass
class Span:
    """First and last stamp of a bag's messages, nanoseconds."""

    first_ns: int = _NO_MESSAGE_NS
    last_ns: int = 0

    def include(self, stamp_ns: int) -> None:
        """Widen the span so that it holds the stamp."""
        self.first_ns = min(self.first_ns, stamp_ns)
        self.last_ns = max(self.last_ns, stamp_ns)

    @property
    def duration_ns(self) -> int:
        """Nanoseconds from the first to the last message, 0 without messages."""
        return max(0, self.last_ns - self.first_ns)


class FileLike(Protocol):
    """What `merged` needs to know of a storage file."""

    summaries: dict[str, TopicSummary]


def merged(files: Sequence[FileLike]) -> list[TopicSummary]:
    """Add the topics of several files up, in the order of their first appearance."""
    found: dict[str, TopicSummary] = {}
    for file in files:
        for name, summary in file.summaries.items():
            if name in found:
                found[name].message_count += summary.message_count
            else:
                found[name] = replace(summary)
    return list(found.values())


def bag_information(files: Sequence[tuple[str, int, Span]], topics: Sequence[TopicSummary]) -> dict[str, object]:
    """Build `rosbag2_bagfile_information` of a bag, keys in rosbag2's order.

    Args:
        files: name, number of messages and span of each MCAP file.
        topics: all topics with the messages in all files.
    """
    whole = Span()
    for _, count, span in files:
        if count:
            whole.include(span.first_ns)
            whole.include(span.last_ns)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **_times(whole),
        "message_count": sum(count for _, count, _ in files),
        "topics_with_message_count": [_topic(topic) for topic in topics],
        # Chunks are compressed inside the MCAP file, which rosbag2 doesn't count as compression of the bag.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [name for name, _, _ in files],
        "files": [_file(*file) for file in files],
        "custom_data": None,
        "ros_distro": ROS_DISTRO,
    }


def _times(span: Span) -> dict[str, object]:
    return {
        "duration": {"nanoseconds": span.duration_ns},
        "starting_time": {"nanoseconds_since_epoch": span.first_ns},
    }


def _file(name: str, message_count: int, span: Span) -> dict[str, object]:
    times = _times(span)
    # In the list of files rosbag2 has the two the other way round.
    return {
        "path": name,
        "starting_time": times["starting_time"],
        "duration": times["duration"],
        "message_count": message_count,
    }


def _topic(topic: TopicSummary) -> dict[str, object]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": [profile.to_mapping() for profile in topic.profiles],
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.message_count,
    }
