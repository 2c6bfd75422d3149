"""What is in a bag, for people and programs: the figures of `ros2 bag info`."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from robot_formation.bag.folder import storage_files
from robot_formation.bag.formation_bag import formation_namespaces
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.metadata import TopicSummary
from robot_formation.bag.reader import read_bag
from robot_formation.bag.run_details import value
from robot_formation.json_values import JsonObject
from robot_formation.system.files import size_text

_DETAILS = ("scenario", "seed", "predictor", "surface", "stand_ins", "git_commit", "dropped", "lost")
_EARLIEST_DATE_NS = 10**18  # September 2001: no clock of a ROS robot that was set has shown an earlier date


@dataclass(frozen=True)
class BagInfo:
    """A bag's summary.

    Attributes:
        path: the bag.
        closed: whether its writer has closed it; if not, the figures are those of what can be recovered.
        storage: `mcap` or `sqlite3`.
        files: names of its storage files.
        size_bytes: their size together.
        compression: of its chunks: `zstd`, `lz4` or `none`; `sqlite3` bags and other makes may say otherwise.
        ros_distro: the distribution that recorded it; empty if unknown.
        start_ns: log time of the first message, nanoseconds.
        end_ns: log time of the last message, nanoseconds.
        topics: its topics with type, QoS and number of messages.
        details: the texts of its metadata record `robot_formation`.
        warnings: what is wrong with it though it can be read.
    """

    path: Path
    closed: bool
    storage: str
    files: tuple[str, ...]
    size_bytes: int
    compression: str
    ros_distro: str
    start_ns: int
    end_ns: int
    topics: tuple[TopicSummary, ...]
    details: dict[str, str]
    warnings: tuple[str, ...] = ()

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return sum(topic.message_count for topic in self.topics)

    @property
    def simulated_time(self) -> bool | None:
        """Whether the log times are a simulation's seconds since its start, and no dates.

        None where they are early, but nothing says that a run was recorded: a board without a battery for its clock
        starts in 1970.
        """
        if self.message_count == 0 or self.end_ns >= _EARLIEST_DATE_NS:
            return False
        return True if "scenario" in self.details else None

    def to_mapping(self) -> JsonObject:
        """Return what `--json` prints."""
        return {
            "bag": str(self.path),
            "closed": self.closed,
            "storage": self.storage,
            "files": list(self.files),
            "size_bytes": self.size_bytes,
            "compression": self.compression,
            "ros_distro": self.ros_distro or None,
            "start_ns": self.start_ns,
            "end_ns": self.end_ns,
            "simulated_time": self.simulated_time,
            "duration_s": (self.end_ns - self.start_ns) / 1e9,
            "messages": self.message_count,
            "topics": [_topic(topic) for topic in self.topics],
            "metadata": {key: value(text) for key, text in self.details.items()},
            "warnings": list(self.warnings),
        }


def bag_info(path: str | Path) -> BagInfo:
    """Summarise a bag; arguments and errors as for `read_bag`, but it may be empty."""
    with read_bag(path, allow_empty=True) as bag:
        files = storage_files(bag.path)
        return BagInfo(
            path=bag.path,
            closed=not bag.recovered,
            storage="sqlite3" if ".db3" in "".join(file.name for file in files) else "mcap",
            files=tuple(file.name for file in files),
            size_bytes=sum(file.stat().st_size for file in files),
            compression="unknown" if bag.recovered else bag.compression,
            ros_distro=bag.ros_distro,
            start_ns=bag.start_ns,
            end_ns=bag.end_ns,
            topics=tuple(bag.contents),
            details=bag.metadata(METADATA_NAME),
            warnings=tuple(bag.warnings),
        )


def info_text(info: BagInfo) -> str:
    """Write the summary as `ros2 bag info` does."""
    facts = [
        ("Files", "\n".join(info.files)),
        ("Bag size", size_text(info.size_bytes)),
        ("Storage id", f"{info.storage}, compression {info.compression}"),
        ("ROS Distro", info.ros_distro or "unknown"),
        ("Duration", f"{(info.end_ns - info.start_ns) / 1e9:.9f}s"),
        ("Start", _date(info.start_ns, info.simulated_time)),
        ("End", _date(info.end_ns, info.simulated_time)),
        ("Messages", str(info.message_count)),
        *((key, info.details[key]) for key in _DETAILS if info.details.get(key)),
    ]
    facts += [("Warning", warning) for warning in info.warnings]
    formations = formation_namespaces(topic.name for topic in info.topics if topic.message_count)
    if any(formations):
        facts.append(("Formations in", ", ".join(namespace or "/" for namespace in formations)))
    if not info.closed:
        facts.insert(0, ("Not closed", f"figures of what 'formation recover {info.path}' would save"))
    lines = []
    for name, text in facts:
        first, *others = text.splitlines() or [""]
        lines += [f"{name + ':':<18} {first}", *(f"{'':<18} {line}" for line in others)]
    width = max((len(topic.name) for topic in info.topics), default=0)
    type_width = max((len(topic.type_name) for topic in info.topics), default=0)
    lines.append("Topic information:")
    lines += [
        f"  {topic.name:<{width}} | Type: {topic.type_name:<{type_width}} | Count: {topic.message_count:>7} | "
        f"QoS: {_qos(topic)}"
        for topic in info.topics
    ]
    return "\n".join(lines)


def _topic(topic: TopicSummary) -> JsonObject:
    return {
        "name": topic.name,
        "type": topic.type_name,
        "messages": topic.message_count,
        "type_hash": topic.type_hash or None,
        "offered_qos_profiles": [profile.to_mapping() for profile in topic.profiles],
    }


def _qos(topic: TopicSummary) -> str:
    kinds = {f"{profile.reliability} {profile.durability}".replace("_", " ") for profile in topic.profiles}
    return ", ".join(sorted(kinds)) or "unknown"


def _date(stamp_ns: int, simulated: bool | None) -> str:
    seconds, nanoseconds = divmod(stamp_ns, 10**9)
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(seconds))
    note = {True: ", simulated time", None: ", simulated time or a clock that was not set"}.get(simulated, "")
    return f"{when} UTC ({seconds}.{nanoseconds:09d}){note}"
