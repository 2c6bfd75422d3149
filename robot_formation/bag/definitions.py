"""Message definitions and type hashes of ROS 2 Jazzy, from rosbags' type store: no ROS installation is needed."""

from __future__ import annotations

import os
import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from robot_formation.bag.errors import BagError

_TYPE_NAME = re.compile(r"\w+/msg/\w+")


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

    Types that ROS 2 Jazzy doesn't have are taken from the installed packages (AMENT_PREFIX_PATH).

    Raises:
        BagError: neither has such a message type.
    """
    store = jazzy_typestore()
    if type_name not in store.fielddefs:
        found = _installed_types(type_name)
        if type_name not in found:
            raise BagError(
                f"ROS 2 Jazzy has no message type '{type_name}', nor has an installed package; give its name in full "
                "(std_msgs/msg/String), or source the workspace that it belongs to"
            )
        store.register({name: fields for name, fields in found.items() if name not in store.fielddefs})
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return Definition(type_name, "ros2msg", text, store.hash_rihs01(type_name))


def _installed_types(type_name: str) -> dict[str, object]:
    """Parse the .msg file of a type and those of the types that it is made of, as far as they are installed."""
    known = jazzy_typestore().fielddefs
    found: dict[str, object] = {}
    wanted = [type_name]
    while wanted:
        name = wanted.pop()
        file = None if name in known or name in found else _message_file(name)
        if file is None:
            continue
        parsed = get_types_from_msg(file.read_text(encoding="utf-8"), name)
        found.update(parsed)
        wanted += [match for match in _TYPE_NAME.findall(repr(parsed)) if match != name]
    return found


def _message_file(type_name: str) -> Path | None:
    package, _, name = type_name.split("/") if type_name.count("/") == 2 else ("", "", "")
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    candidates = [Path(prefix, "share", package, "msg", f"{name}.msg") for prefix in prefixes if prefix and package]
    return next((path for path in candidates if path.is_file()), None)
