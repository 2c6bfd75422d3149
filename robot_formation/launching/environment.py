"""What a node's process needs of its environment, with ROS from pip or from an install."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from robot_formation.network.loopback import BEYOND, MANY_NODES, RANGE, use_loopback, use_profile_for_many
from robot_formation.system.threads import one_thread


def joining(domain: int) -> str:
    """Return the variables with which a program of the user's joins a run, as a shell takes them before a command."""
    return f"ROS_DOMAIN_ID={domain} {RANGE}=LOCALHOST"


def node_environment(domain: int, folder: Path, nodes: int = 1) -> dict[str, str]:
    """Make a process's environment: its own ROS domain on this machine only, and logs that are ours to remove.

    With ROS from pip also AMENT_PREFIX_PATH, which the wheels don't set, is given; LD_LIBRARY_PATH is inherited from
    this process, where the wheels' start-up hook has set it.

    Args:
        domain: ROS domain.
        folder: of the run, for logs and, for many nodes, a profile of the middleware.
        nodes: how many the run has.
    """
    environment = dict(os.environ)
    environment.update(
        ROS_DOMAIN_ID=str(domain),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
        ROS_LOG_DIR=str(folder),
        RCUTILS_LOGGING_USE_STDOUT="0",
        PYTHONUNBUFFERED="1",
        PYTHONSAFEPATH="1",  # a file of the user's folder must not stand in for a library's
    )
    for name in BEYOND:
        environment.pop(name, None)
    environment.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    use_loopback(environment)
    if nodes >= MANY_NODES:
        use_profile_for_many(environment, folder, nodes)
    environment.update(one_thread(environment))
    return environment
