"""Quality of service of a recorded topic, in the words and the YAML that rosbag2 uses from metadata version 9 on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from robot_formation.bag.errors import BagError
from robot_formation.errors import shown
from robot_formation.json_values import Json
from robot_formation.names import Qos
from robot_formation.system.yaml_files import YamlError, parse_yaml, yaml_text

INFINITE_NS = 2**63 - 1
"""RMW_DURATION_INFINITE in nanoseconds: what a publisher without deadline, lifespan or lease reports."""

_CHOICES = {
    "history": ("keep_last", "keep_all", "system_default", "unknown"),
    "reliability": ("reliable", "best_effort", "system_default", "unknown", "best_available"),
    "durability": ("volatile", "transient_local", "system_default", "unknown", "best_available"),
    "liveliness": ("automatic", "manual_by_topic", "system_default", "unknown", "best_available"),
}

# rosbag2 wrote the policies as these numbers (rmw's enumerations) before metadata version 9.
_NUMBERED: dict[str, dict[object, str]] = {
    "history": {0: "system_default", 1: "keep_last", 2: "keep_all", 3: "unknown"},
    "reliability": {0: "system_default", 1: "reliable", 2: "best_effort", 3: "unknown", 4: "best_available"},
    "durability": {0: "system_default", 1: "transient_local", 2: "volatile", 3: "unknown", 4: "best_available"},
    "liveliness": {0: "system_default", 1: "automatic", 3: "manual_by_topic", 4: "unknown", 5: "best_available"},
}


@dataclass(frozen=True)
class TopicQos:
    """What a topic's publisher offers: policies as lower-case names, durations in nanoseconds.

    Raises:
        BagError: on a policy name that ROS 2 doesn't know or a negative depth.
    """

    history: str = "keep_last"
    depth: int = 10
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness: str = "automatic"
    liveliness_lease_duration_ns: int = INFINITE_NS
    avoid_ros_namespace_conventions: bool = False

    def __post_init__(self) -> None:
        for policy, choices in _CHOICES.items():
            if getattr(self, policy) not in choices:
                raise BagError(f"QoS {policy} can't be {shown(getattr(self, policy))}; there are: {', '.join(choices)}")
        if self.depth < 0:
            raise BagError(f"QoS depth can't be {self.depth}; it must be 0 or more")

    @classmethod
    def of(cls, qos: Qos) -> TopicQos:
        """Return what a publisher of one of the project's topics offers."""
        return cls(qos.history, qos.depth, qos.reliability, qos.durability)

    def to_mapping(self) -> dict[str, object]:
        """Return rosbag2's mapping of one offered profile, keys in rosbag2's order."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": _duration(self.deadline_ns),
            "lifespan": _duration(self.lifespan_ns),
            "liveliness": self.liveliness,
            "liveliness_lease_duration": _duration(self.liveliness_lease_duration_ns),
            "avoid_ros_namespace_conventions": self.avoid_ros_namespace_conventions,
        }


@cache
def dump_profiles(profiles: tuple[TopicQos, ...]) -> str:
    """Return the YAML text that rosbag2 keeps in an MCAP channel's `offered_qos_profiles`."""
    return yaml_text([profile.to_mapping() for profile in profiles]).strip()


def parse_profiles(text: str) -> tuple[TopicQos, ...]:
    """Read the offered profiles of an MCAP channel, in the words of version 9 or the numbers of earlier ones.

    Raises:
        BagError: the text isn't a list of QoS profiles.
    """
    try:
        return tuple(_profile(item) for item in parse_yaml(text) or ())
    except (YamlError, KeyError, TypeError, AttributeError) as error:
        raise BagError(f"the bag holds QoS profiles that can't be read ({type(error).__name__})") from error


def _profile(item: Mapping[str, Json]) -> TopicQos:
    policies: dict[str, Json] = {
        policy: numbers.get(item[policy], item[policy]) for policy, numbers in _NUMBERED.items()
    }
    return TopicQos(
        depth=item["depth"],
        deadline_ns=_nanoseconds(item["deadline"]),
        lifespan_ns=_nanoseconds(item["lifespan"]),
        liveliness_lease_duration_ns=_nanoseconds(item["liveliness_lease_duration"]),
        avoid_ros_namespace_conventions=item["avoid_ros_namespace_conventions"],
        **policies,
    )


def _duration(nanoseconds: int) -> dict[str, int]:
    sec, nsec = divmod(nanoseconds, 10**9)
    return {"sec": sec, "nsec": nsec}


def _nanoseconds(duration: Mapping[str, int]) -> int:
    return duration["sec"] * 10**9 + duration["nsec"]
