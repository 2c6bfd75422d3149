"""Message definitions and type hashes of ROS 2 Jazzy, as rosbags' type store has them: no ROS installation is needed.

Those of the project's own topics are kept in a file, since loading rosbags and its store takes 0.1 s, a twelfth of a
short run: `python bench/make_message_definitions.py` writes it.
"""

from __future__ import annotations

import json
import os
import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from robot_formation.bag.errors import BagError

DEFINITIONS_FILE = Path(__file__).with_name("message_definitions.json")
"""By type name: text and hash."""
ENCODING = "ros2msg"
_TYPE_NAME = re.compile(r"\w+/msg/\w+")
_TIMES = (["std_msgs/Header"], ["builtin_interfaces/Time"])
_CONSTANT = re.compile(r"\s*\S+\s+\w+\s*=")
"""As `uint8 MOST=3`; a field may have a "=" too, in its type (`string<=10 name`)."""


class Definition(NamedTuple):
    """A message type as a bag embeds it: name, encoding (`ros2msg`), full concatenated text, RIHS01 hash (REP-2016)."""

    type_name: str
    encoding: str
    text: str
    type_hash: str

    @property
    def begins_with_time(self) -> bool:
        """Whether the first field of a message is a Time or a Header."""
        lines = self.text.partition("=" * 80)[0].splitlines()
        first = next((line for line in lines if line.strip() and not _CONSTANT.match(line)), "")
        return first.split()[:1] in _TIMES


@cache
def jazzy_typestore() -> Any:
    """Return rosbags' type store of ROS 2 Jazzy, loaded when it is first asked for."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


@cache
def definition(type_name: str) -> Definition:
    """Look a message type up, such as `geometry_msgs/msg/PoseStamped`.

    Types that ROS 2 Jazzy doesn't have are taken from the installed packages (AMENT_PREFIX_PATH).

    Raises:
        BagError: neither has such a message type.
    """
    if type_name in (kept := _kept_definitions()):
        return Definition(type_name, ENCODING, *kept[type_name])
    return looked_up(type_name)


@cache
def _kept_definitions() -> dict[str, tuple[str, str]]:
    kept: dict[str, tuple[str, str]] = json.loads(DEFINITIONS_FILE.read_text(encoding="utf-8"))
    return kept


def looked_up(type_name: str) -> Definition:
    """Look a message type up as `definition` does, without the file."""
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
    return Definition(type_name, ENCODING, text, store.hash_rihs01(type_name))


def _installed_types(type_name: str) -> dict[str, object]:
    """Parse the .msg file of a type and those of the types that it is made of, as far as they are installed."""
    from rosbags.typesys import get_types_from_msg

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
