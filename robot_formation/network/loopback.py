"""Keeps a middleware that is limited to this machine off the network: sockets on the loopback interface only."""

from __future__ import annotations

import shutil
from collections.abc import MutableMapping
from pathlib import Path

from robot_formation.errors import FormationError
from robot_formation.network.shared_memory_space import SHARED_MEMORY
from robot_formation.paths import config_dir

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Where Fast DDS looks for profiles: until version 2, and from version 3 on."""
BEYOND = ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER")
"""Variables that let nodes talk beyond this machine, or not find each other."""

MANY_NODES = 16
"""From so many nodes on, a run's graph has a profile of its own."""
_XML = "http://www.eprosima.com"
_SEGMENT_BYTES = 2 * 1024 * 1024
_ANNOUNCEMENTS, _ANNOUNCEMENT_PERIOD_NS = 8, 300_000_000


def stay_here(environment: MutableMapping[str, str]) -> None:
    """Change a process's environment so that it finds nodes on this machine only, unless it says something else.

    It must be called before the process joins the graph for the first time.
    """
    if not any(environment.get(name) for name in (RANGE, "ROS_LOCALHOST_ONLY", *BEYOND)):
        environment[RANGE] = "LOCALHOST"
    use_loopback(environment)


def use_loopback(environment: MutableMapping[str, str]) -> None:
    """Change a process's environment so that Fast DDS opens sockets on the loopback interface only.

    Discovery that is limited to this machine (ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST) only ignores foreign hosts:
    the sockets are open to the network all the same. A profile (config/loopback.xml) binds them; the range is then
    SYSTEM_DEFAULT, since ROS would add its own sockets to those of the profile otherwise. Nothing is changed where
    another range, static peers, a discovery server, a profile of the user's or another middleware is set.

    It must be called before the process joins the graph for the first time: Fast DDS reads profiles once.
    """
    if environment.get(RANGE) != "LOCALHOST" or any(environment.get(name) for name in BEYOND):
        return
    if not environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp").startswith("rmw_fastrtps"):
        return
    try:
        profile = config_dir() / "loopback.xml"
    except FormationError:
        return
    if any(environment.get(name, str(profile)) not in ("", str(profile)) for name in PROFILES):
        return
    if profile.is_file():
        environment.update({**dict.fromkeys(PROFILES, str(profile)), RANGE: "SYSTEM_DEFAULT"})


def use_profile_for_many(environment: MutableMapping[str, str], folder: Path, nodes: int) -> None:
    """Change a process's environment so that many nodes that start at once find each other with fewer packets.

    The profile is a copy of config/loopback.xml, written into `folder`. Segments of shared memory are larger, since
    Fast DDS takes the smaller of segment and send buffer for `sendBufferSize`; they take memory, so a small graph does
    without, as does one for which /dev/shm is too small (64 MB in a container by default). And nodes announce
    themselves fewer times, but for as long as 45 nodes need to start on two cores. Nothing is changed where that file
    is not in use. Time until the first timestep of ten followers: bench/chain_graph.py.
    """
    profile = environment.get(PROFILES[0], "")
    if not profile or profile != str(config_dir() / "loopback.xml"):
        return
    from xml.etree import ElementTree  # every node imports this module, and few runs come here

    ElementTree.register_namespace("", _XML)  # Fast DDS knows no prefixes
    tree = ElementTree.parse(profile)
    if SHARED_MEMORY.is_dir() and shutil.disk_usage(SHARED_MEMORY).free > 2 * nodes * _SEGMENT_BYTES:
        transports = tree.iter(_tag("transport_descriptor"))
        (shared_memory,) = (transport for transport in transports if transport.findtext(_tag("type")) == "SHM")
        ElementTree.SubElement(shared_memory, _tag("segment_size")).text = str(_SEGMENT_BYTES)
    (announcements,) = tree.iter(_tag("initialAnnouncements"))
    (count,), (period,) = announcements.iter(_tag("count")), announcements.iter(_tag("nanosec"))
    count.text, period.text = str(_ANNOUNCEMENTS), str(_ANNOUNCEMENT_PERIOD_NS)
    changed = folder / "loopback_many.xml"
    tree.write(changed, encoding="UTF-8", xml_declaration=True)
    environment.update(dict.fromkeys(PROFILES, str(changed)))


def _tag(name: str) -> str:
    return f"{{{_XML}}}{name}"
