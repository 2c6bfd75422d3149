"""Where a bag is written: what its folder is called until it is complete, and who may write it."""

from __future__ import annotations

import os
import socket
import zlib
from itertools import count
from pathlib import Path
from types import TracebackType

from robot_formation.bag.errors import BagError
from robot_formation.system.reservation import reserve

PARTIAL_SUFFIX = ".partial"
"""What a bag's folder is called while it is being written, behind its name."""
CUT_OFF_SUFFIX = ".cut_off"
"""What the folder of a bag whose writer died is called while the bag is being rescued."""


def recover_hint(partial_path: Path) -> str:
    """Describe how to save what is in a bag that could not be finished."""
    return f" ('formation recover {partial_path}' saves what was written)"


def check_free(path: Path, leftovers: tuple[str, ...] = (PARTIAL_SUFFIX, CUT_OFF_SUFFIX)) -> None:
    """Refuse a bag's path that is taken, by a bag or by what is left of one; also by a link that leads nowhere.

    Raises:
        BagError: naming what is there.
    """
    if not path.name:
        raise BagError(f"{path} can't be a bag: give the name of a new folder")
    for suffix in ("", *leftovers):
        taken = path.with_name(path.name + suffix)
        if os.path.lexists(taken):
            raise BagError(f"{taken} exists already and is not overwritten; choose another path or remove it")


class PathReservation:
    """Keeps a bag's path for one run of this machine: a context manager; gone with its process, and no file is left.

    Raises:
        BagError: on entering, if another run has it, or it can't be reserved.
    """

    def __init__(self, path: Path) -> None:
        self.path = path.absolute()
        self._socket: socket.socket | None = None

    def take(self) -> bool:
        """Reserve the path; return False if another process has it. Entering it again later changes nothing.

        Raises:
            BagError: this system doesn't let it be reserved, whoever has it.
        """
        if self._socket is not None:
            return True
        # Two checksums are enough to tell paths apart; hashlib would load OpenSSL, which takes 2 MB.
        text = str(self.path).encode()
        try:
            self._socket = reserve(f"bag_{zlib.crc32(text):08x}{zlib.adler32(text):08x}")
        except OSError as error:
            raise BagError(f"{self.path} can't be reserved: {error.strerror or error}") from error
        return self._socket is not None

    def release(self) -> None:
        """Let others have the path."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def __enter__(self) -> PathReservation:
        if not self.take():
            raise BagError(f"{self.path} is being written by another run; choose another path")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def reserve_new(folder: Path, stem: str) -> PathReservation:
    """Reserve the first free name of STEM, STEM_2, STEM_3, ... in a folder, so that no other run can choose it too.

    Returns:
        The reservation, taken already; enter it, or release it.

    Raises:
        BagError: this system doesn't let paths be reserved.
    """
    for number in count(1):
        reservation = PathReservation(folder / (stem if number == 1 else f"{stem}_{number}"))
        if not reservation.take():
            continue
        try:
            check_free(reservation.path)
        except BagError:
            reservation.release()
            continue
        return reservation
    raise AssertionError("never reached: the count has no end")
