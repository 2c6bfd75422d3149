"""Temporary folders that a killed process leaves for the next one to remove: of runs, and of bags that are unpacked."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

RUN = "robot_formation_run_"
"""How the name of a run's folder begins: parameter files and logs."""
BAG = "robot_formation_bag_"
"""The same of a folder for what a bag is unpacked or recovered into."""
_LOCK = "owner"
_OLD_S = 60.0  # a folder is locked at once after it was made; one that is older and has no lock lost its owner before


@contextlib.contextmanager
def temporary_folder(prefix: str, parent: Path | None = None) -> Iterator[Path]:
    """Make a folder that is gone at the end; first remove those whose owners are dead.

    The owner keeps a file in it locked (flock): the kernel opens the lock when the owner dies, however that happens,
    and processes that it starts don't inherit it.

    Args:
        prefix: `RUN` or `BAG`.
        parent: where folders are made; by default where the system keeps temporary files.
    """
    parent = parent or Path(tempfile.gettempdir())
    remove_orphans(parent)
    folder, lock = _locked_folder(prefix, parent)
    try:
        with lock:
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_orphans(parent: Path) -> list[Path]:
    """Remove the folders whose owners are dead; return them. Those that this user may not remove are passed over."""
    removed = []
    for folder in sorted([*parent.glob(f"{RUN}*"), *parent.glob(f"{BAG}*")]):
        with contextlib.suppress(OSError):
            if not folder.is_symlink() and folder.stat().st_uid == os.getuid() and _remove_abandoned(folder):
                removed.append(folder)
    return removed


def _locked_folder(prefix: str, parent: Path) -> tuple[Path, IO[str]]:
    """Make a folder and lock its file, which stays locked until it is closed."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        with contextlib.suppress(FileNotFoundError):  # the folder was removed before it had its file
            lock = (folder / _LOCK).open("w")
            fcntl.flock(lock, fcntl.LOCK_EX)
            if os.fstat(lock.fileno()).st_nlink > 0:
                return folder, lock
            lock.close()  # between these lines it looked abandoned, and another process removed it


def _remove_abandoned(folder: Path) -> bool:
    """Remove a folder if nobody holds its lock, while holding it: its owner may be about to take it."""
    path = folder / _LOCK
    if not path.exists() and time.time() - folder.stat().st_mtime <= _OLD_S:
        return False
    with path.open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        if os.fstat(lock.fileno()).st_nlink == 0:
            return False  # another process has just removed it
        shutil.rmtree(folder)
    return True
