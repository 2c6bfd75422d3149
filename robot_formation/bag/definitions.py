"""Message definitions and type hashes of ROS 2 Jazzy, from rosbags' type store: no ROS installation is needed."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_typestore

from robot_formation.bag.errors import BagError


class Definition(NamedTuple):
    """A message type as a bag embeds it: name, encoding (`ros2msg`), full concatenated text, RIHS01 hash (REP-2016)."""

    type_name: str
    encoding: str
    text: str
    type_hash: str


@cache
def jazzy_typestore() -> Any:
    """Return rosbags' type store of ROS 2 Jazzy (made once: it takes about 60 ms)."""
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def definition(type_name: str) -> Definition:
    """Look a message type up, such as `geometry_msgs/msg/PoseStamped`.

    Raises:
        BagError: ROS 2 Jazzy has no such message type.
    """
    store = jazzy_typestore()
    if type_name not in store.fielddefs:
        raise BagError(f"ROS 2 Jazzy has no message type '{type_name}'; give its name in full (std_msgs/msg/String)")
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return Definition(type_name, "ros2msg", text, store.hash_rihs01(type_name))
