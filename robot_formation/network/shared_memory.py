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
from collections.abc import Iterator
from pathlib import Path

from robot_formation.network.port_mutex import PortMutex
from robot_formation.network.ros_domain import FIRST_PORT, domain_ports
from robot_formation.network.shared_memory_space import SHARED_MEMORY

_NAME = re.compile(r"(?:sem\.)?(?P<group>fastrtps_(?:[0-9a-f]{16}|port(?P<port>\d+)))(?P<part>_el|_sl|_mutex)?")
_ROUNDS, _ROUND_S = 6, 0.05
_MUTEX_LOOKS, _MUTEX_LOOK_S = 3, 0.02
"""A living process has a port's mutex for milliseconds."""


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


def find_orphans(
    domain: int | None = None, folder: Path = SHARED_MEMORY, *, own_ports: bool = True
) -> dict[str, list[str]]:
    """List the groups of files whose owners are all dead; removes nothing. Arguments as for clean_orphans.

    Processes of other containers that share the folder are not seen here; their locks are, while files are removed.
    """
    groups = {group: names for group, names in fast_dds_files(folder).items() if _is_of_domain(group, domain)}
    if not groups:
        return {}
    use = _Use(folder, own_ports=own_ports)
    return {group: names for group, names in groups.items() if use.lacks(names)}


def clean_orphans(domain: int | None = None, folder: Path = SHARED_MEMORY, *, own_ports: bool = True) -> list[str]:
    """Remove the files whose owners are dead, and never a living process' files.

    A port is removed under its mutex, so that it is not half open: a process that had just opened a dead one's port
    would lose the port's file and lock the new lock file, and all processes started later would find this port broken.
    The mutex is kept for as short as can be, for its file is removed too: who waits for the former one is not kept from
    who makes a new one. Segments are opened by one process, and have no mutex.

    Args:
        domain: Leave the ports of other domains alone. Segments, and the ports below 7400, carry no domain in their
            name and are removed in any case. None: every domain.
        folder: Where shared memory lies.
        own_ports: Whether a port is in use that this process has mapped and nobody has locked. False where this process
            has no participant any more: Fast DDS keeps for a while what it has sent to.

    Returns:
        The names of the removed files. Files that this user may not remove are passed over.
    """
    removed: list[str] = []
    for group in find_orphans(domain, folder, own_ports=own_ports):
        if folder != SHARED_MEMORY or "port" not in group:
            removed += _remove_unlocked(group, folder)
            continue
        with contextlib.suppress(OSError), _taken(group):
            removed += _remove_unlocked(group, folder)
    return removed


@contextlib.contextmanager
def _taken(port: str) -> Iterator[None]:
    """Keep a port's mutex; that of an owner who was killed while it had the mutex is void.

    Raises:
        OSError: if a living process has the mutex, or it can't be opened.
    """
    with contextlib.ExitStack() as stack:
        for _ in range(_MUTEX_LOOKS):
            if stack.enter_context(PortMutex(port)):
                break
            stack.close()
            time.sleep(_MUTEX_LOOK_S)
        else:
            if not _Use(SHARED_MEMORY, own_ports=True).lacks([f"sem.{port}_mutex"]):
                raise BlockingIOError(f"{port} is being opened")
        yield


def clean_after_graph(domain: int) -> None:
    """Remove what dead processes left, in rounds: Fast DDS lets go of this domain's last files in its own time."""
    clean_orphans()
    for _ in range(_ROUNDS):
        ports = {f"fastrtps_port{port}" for port in domain_ports(domain)}
        if ports.isdisjoint(fast_dds_files()):
            return
        clean_orphans(domain, own_ports=False)
        time.sleep(_ROUND_S)


def _remove_unlocked(group: str, folder: Path) -> list[str]:
    """Remove a group's files as they are now, unless one is locked; returns the names of those removed."""
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


class _Use:
    """Which of the folder's files any process has open, mapped or locked now, as far as this user can see.

    A starting process opens its lock file just before it locks it, so a free lock alone does not mean a dead owner. To
    try locks would make those fail who want them at that moment.
    """

    def __init__(self, folder: Path, *, own_ports: bool) -> None:
        self._folder, self._own_ports = folder, own_ports
        self._prefix = f"{folder}/"
        self._names: set[str] = set()
        self._places: set[str] = set()  # device and inode, where names don't tell
        self._read_locks()
        for process in Path("/proc").glob("[0-9]*"):
            own = process.name == str(os.getpid())
            with contextlib.suppress(OSError):
                self._read_maps(process, own)
            with contextlib.suppress(OSError):
                for descriptor in os.listdir(process / "fd"):
                    with contextlib.suppress(OSError):
                        self._add(os.readlink(process / "fd" / descriptor), own)

    def lacks(self, names: list[str]) -> bool:
        """Return whether these files are there, and nobody uses any of them."""
        try:
            places = {self._place(name) for name in names}
        except OSError:  # its owner is ending in good order
            return False
        return bool(names) and self._names.isdisjoint(names) and self._places.isdisjoint(places)

    def _place(self, name: str) -> str:
        status = (self._folder / name).stat()
        return f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"

    def _add(self, path: str, own: bool) -> None:
        """Note a file that a process, which may be this one, has open or mapped.

        Fast DDS keeps other processes' segments mapped for a while after the last participant has gone. In this process
        that is no use of them: a segment's owner, which may be this process, has its lock file locked.
        """
        name = path.removeprefix(self._prefix)
        match = _NAME.fullmatch(name)
        unused = own and match and match["part"] is None and (match["port"] is None or not self._own_ports)
        if name != path and not unused:
            self._names.add(name)

    def _read_locks(self) -> None:
        with contextlib.suppress(OSError):
            for line in Path("/proc/locks").read_text().splitlines():
                self._places.update(word for word in line.split() if word.count(":") == 2)

    def _read_maps(self, process: Path, own: bool) -> None:
        for line in (process / "maps").read_text(errors="replace").splitlines():
            place = line.find(self._prefix)
            if place < 0:
                continue
            if not line.startswith("sem.", place + len(self._prefix)):
                self._add(line[place:], own)
            elif not own:  # this process takes mutexes only here
                # The mapping's name may be the one that the file had while it was made.
                device, inode = line.split(maxsplit=5)[3:5]
                self._places.add(f"{device}:{inode}")
