"""Removes what killed ROS processes leave in shared memory.

Fast DDS gives a process segments (`fastrtps_<16 hex digits>`) and ports (`fastrtps_port<N>` with a semaphore
`sem.fastrtps_port<N>_mutex`). Beside each lies a file ending in `_el` (`_sl` where several share a port) that its owner
keeps locked (flock), and the kernel opens that lock when the owner dies, however that happens. A process that ends in
good order removes its files itself.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import time
from pathlib import Path

from robot_formation.network.port_mutex import PortMutex
from robot_formation.network.ros_domain import FIRST_PORT, domain_ports
from robot_formation.network.shared_memory_space import SHARED_MEMORY

_NAME = re.compile(r"(?:sem\.)?(?P<group>fastrtps_(?:[0-9a-f]{16}|port(?P<port>\d+)))(?P<part>_el|_sl|_mutex)?")


_ROUNDS, _ROUND_S = 6, 0.05


class TracingFiles:
    """Notes LTTng's wake-up files at a time before ROS is loaded, so that those made since can be removed.

    ROS's tracing library makes `lttng-ust-wait-*` as soon as it is loaded and never removes it; the next program that
    traces makes it anew.
    """

    def __init__(self, folder: Path = SHARED_MEMORY) -> None:
        self._folder = folder
        self._before = set(folder.glob("lttng-ust-wait-*"))

    def remove_new(self) -> None:
        """Remove what was made since."""
        for path in set(self._folder.glob("lttng-ust-wait-*")) - self._before:
            with contextlib.suppress(OSError):
                path.unlink()


def fast_dds_files(folder: Path = SHARED_MEMORY) -> dict[str, list[str]]:
    """List Fast DDS' files by the segment or port that they belong to; empty where the folder can't be read."""
    groups: dict[str, list[str]] = {}
    with contextlib.suppress(OSError):
        for name in sorted(os.listdir(folder)):
            match = _NAME.fullmatch(name)
            if match:
                groups.setdefault(match["group"], []).append(name)
    return groups


def find_orphans(domain: int | None = None, folder: Path = SHARED_MEMORY) -> dict[str, list[str]]:
    """List the groups of files whose owners are all dead; removes nothing. Arguments as for clean_orphans."""
    groups = {group: names for group, names in fast_dds_files(folder).items() if _is_of_domain(group, domain)}
    if not groups:
        return {}
    in_use = _in_use(folder) | _locked()
    return {group: names for group, names in groups.items() if in_use.isdisjoint(_inodes(folder, names))}


def clean_orphans(domain: int | None = None, folder: Path = SHARED_MEMORY) -> list[str]:
    """Remove the files whose owners are dead, and never a living process' files.

    Args:
        domain: Leave the ports of other domains alone. Segments, and the ports below 7400, carry no domain in their
            name and are removed in any case. None: every domain.
        folder: Where shared memory lies.

    Returns:
        The names of the removed files. Files that this user may not remove are passed over.
    """
    removed: list[str] = []
    for group in find_orphans(domain, folder):
        if folder != SHARED_MEMORY or "port" not in group:  # segments are opened by one process, and have no mutex
            removed += _remove_unlocked(group, folder)
            continue
        with contextlib.suppress(OSError):
            with PortMutex(group) as taken:
                if taken:
                    removed += _remove_unlocked(group, folder)
            if not taken and _in_use(folder).isdisjoint(_inodes(folder, [f"sem.{group}_mutex"])):
                removed += _remove_unlocked(group, folder)  # its owner was killed while it had the mutex
    return removed


def clean_after_graph(domain: int) -> None:
    """Remove what dead processes left, this domain's in rounds: Fast DDS lets go of the last files in its own time."""
    for _ in range(_ROUNDS):
        clean_orphans()
        if not any(_is_of_domain(group, domain) for group in fast_dds_files()):
            return
        time.sleep(_ROUND_S)


def _remove_unlocked(group: str, folder: Path) -> list[str]:
    """Remove a group's files as they are now, unless one is locked; returns the names of those removed.

    Under the port's mutex none is half open. Without the mutex a process that had just opened a dead one's port lost
    the port's file, locked the new lock file, and every process started afterwards found this port broken.
    """
    names = fast_dds_files(folder).get(group, [])
    held = _lock_all(folder, names)
    if held is None:
        return []
    removed = []
    for name in names:
        with contextlib.suppress(OSError):
            (folder / name).unlink()
            removed.append(name)
    _unlock(held)
    return removed


def _is_of_domain(group: str, domain: int | None) -> bool:
    """Return whether a group may be one of this domain: a segment, a port of the domain, or one that all share."""
    match = _NAME.fullmatch(group)
    if domain is None or match is None or match["port"] is None:
        return True
    port = int(match["port"])
    return port < FIRST_PORT or port in domain_ports(domain)


def _locked() -> set[int]:
    """List the inodes of locked files. To try their locks would make those fail who want them at that moment."""
    found = set()
    with contextlib.suppress(OSError):
        for line in Path("/proc/locks").read_text().splitlines():
            place = next(word for word in line.split() if word.count(":") == 2)  # major:minor:inode
            found.add(int(place.rpartition(":")[2]))
    return found


def _lock_all(folder: Path, names: list[str]) -> list[int] | None:
    """Lock a group's lock files; returns their descriptors, None if an owner lives.

    There may be none to lock: the last one in good order to leave a port that a killed process shared takes the lock
    files with it and leaves the port.
    """
    held: list[int] = []
    for name in names:
        if not name.endswith(("_el", "_sl")):
            continue
        try:
            held.append(os.open(folder / name, os.O_RDONLY | os.O_CLOEXEC))
            fcntl.flock(held[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            _unlock(held)
            return None
    return held


def _unlock(descriptors: list[int]) -> None:
    for descriptor in descriptors:
        os.close(descriptor)


def _inodes(folder: Path, names: list[str]) -> set[int]:
    found = set()
    for name in names:
        with contextlib.suppress(OSError):
            found.add((folder / name).stat().st_ino)
    return found


def _in_use(folder: Path) -> set[int]:
    """List the inodes of the folder's files that any process has open or mapped, as far as this user can see.

    A starting process opens its lock file just before it locks it, so a free lock alone does not mean a dead owner.
    Inodes, as a semaphore's mapping carries the name that it had while it was made.
    """
    prefix = f"{folder}/"
    found: set[int] = set()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            for line in (process / "maps").read_text().splitlines():
                if prefix in line:
                    found.add(int(line.split(maxsplit=5)[4]))
        with contextlib.suppress(OSError):
            for descriptor in os.listdir(process / "fd"):
                with contextlib.suppress(OSError):
                    if os.readlink(process / "fd" / descriptor).startswith(prefix):
                        found.add((process / "fd" / descriptor).stat().st_ino)
    return found
