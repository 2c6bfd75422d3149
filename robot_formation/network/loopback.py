"""Keeps a middleware that is limited to this machine off the network: sockets on the loopback interface only."""

from __future__ import annotations

from collections.abc import MutableMapping

from robot_formation.errors import FormationError
from robot_formation.paths import config_dir

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Where Fast DDS looks for profiles: until version 2, and from version 3 on."""
BEYOND = ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER")
"""Variables that let nodes talk beyond this machine, or not find each other."""


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
