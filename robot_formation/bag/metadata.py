"""rosbag2's metadata, version 9: the contents of `metadata.yaml` and of the MCAP record `rosbag2`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import yaml

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


def bag_information(file_name: str, topics: Sequence[TopicSummary], span: Span) -> dict[str, Any]:
    """Build `rosbag2_bagfile_information` of a bag with one MCAP file, keys in rosbag2's order."""
    count = sum(topic.message_count for topic in topics)
    start = {"nanoseconds_since_epoch": span.first_ns}
    duration = {"nanoseconds": span.duration_ns}
    file = {
        "path": file_name,
        "starting_time": dict(start),
        "duration": dict(duration),
        "message_count": count,
    }
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": duration,
        "starting_time": start,
        "message_count": count,
        "topics_with_message_count": [_topic(topic) for topic in topics],
        # Chunks are compressed inside the MCAP file, which rosbag2 doesn't count as compression of the bag.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [file],
        "custom_data": None,
        "ros_distro": ROS_DISTRO,
    }


def to_yaml(value: Any) -> str:
    """Write YAML in the given key order."""
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=False)


def _topic(topic: TopicSummary) -> dict[str, Any]:
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
