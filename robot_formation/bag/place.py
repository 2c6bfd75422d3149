"""Where a bag is written: what its folder is called until it is complete, and who may write it."""

from __future__ import annotations

import hashlib
import socket
from pathlib import Path
from types import TracebackType

from robot_formation.bag.errors import BagError

PARTIAL_SUFFIX = ".partial"
"""What a bag's folder is called while it is being written, behind its name."""
CUT_OFF_SUFFIX = ".cut_off"
"""What the folder of a bag whose writer died is called while the bag is being rescued."""


def check_free(path: Path, leftovers: tuple[str, ...] = (PARTIAL_SUFFIX, CUT_OFF_SUFFIX)) -> None:
    """Refuse a bag's path that is taken, by a bag or by what is left of one.

    Raises:
        BagError: naming what is there.
    """
    if not path.name:
        raise BagError(f"{path} can't be a bag: give the name of a new folder")
    for suffix in ("", *leftovers):
        taken = path.with_name(path.name + suffix)
        if taken.exists():
            raise BagError(f"{taken} exists already and is not overwritten; choose another path or remove it")


class PathReservation:
    """Keeps a bag's path for one run of this machine: a context manager; gone with its process, and no file is left.

    Raises:
        BagError: on entering, if another run has it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path.absolute()
        self._socket: socket.socket | None = None

    def __enter__(self) -> PathReservation:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        name = hashlib.sha256(str(self._path).encode()).hexdigest()
        try:
            self._socket.bind(f"\0robot_formation_bag_{name}")
        except OSError:
            self._socket.close()
            raise BagError(f"{self._path} is being written by another run; choose another path") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._socket is not None:
            self._socket.close()
