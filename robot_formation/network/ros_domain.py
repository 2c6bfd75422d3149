"""A ROS domain of one's own: runs on one machine don't hear each other.

A domain is reserved by an abstract Unix socket: taken in one step, gone with its process, and no file is left. Graphs
that don't reserve theirs are seen by their UDP ports: Fast DDS and the other DDS makes use 7400 + 250 * domain and the
249 ports above it (DDSI-RTPS 2.3, section 9.6.1.1).
"""

from __future__ import annotations

import contextlib
import os
import socket
from pathlib import Path
from types import TracebackType

from robot_formation.errors import FormationError
from robot_formation.system.reservation import reserve

FIRST_PORT = 7400
PORTS_PER_DOMAIN = 250
# 0 is what everybody uses by default; the ports above 100's reach into those that Linux hands out.
DOMAINS = range(1, 101)


class DomainError(FormationError):
    """No ROS domain is free."""


def domain_ports(domain: int) -> range:
    """List the UDP ports that belong to a domain."""
    first = FIRST_PORT + PORTS_PER_DOMAIN * domain
    return range(first, first + PORTS_PER_DOMAIN)


class DomainReservation:
    """Keeps a ROS domain id for as long as it is open; a context manager that gives the id.

    The search starts at a place that depends on `start`, so that programs started together rarely meet.

    Raises:
        DomainError: on entering, if every domain is taken.
    """

    def __init__(self, start: int | None = None) -> None:
        self._start = os.getpid() if start is None else start
        self._socket: socket.socket | None = None

    def __enter__(self) -> int:
        used = _used_udp_ports()
        for step in range(len(DOMAINS)):
            domain = DOMAINS[(self._start * 37 + step) % len(DOMAINS)]
            if not used.isdisjoint(domain_ports(domain)):
                continue
            with contextlib.suppress(OSError):  # where none can be reserved, none is free
                self._socket = reserve(f"domain_{domain}")
            if self._socket is not None:
                return domain
        raise DomainError(
            f"no ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is free: end other runs or ROS graphs on this machine"
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def free_domain() -> int:
    """Find a domain that is free now, without keeping it.

    Raises:
        DomainError: if every domain is taken.
    """
    with DomainReservation(0) as domain:
        return domain


def _used_udp_ports() -> set[int]:
    """Read which UDP ports are bound on this machine (reading disturbs nobody, as trying to bind them would)."""
    ports: set[int] = set()
    for table in ("udp", "udp6"):
        with contextlib.suppress(OSError):
            for line in Path("/proc/net", table).read_text().splitlines()[1:]:
                ports.add(int(line.split()[1].rpartition(":")[2], 16))
    return ports
