"""The temporary folder of a run: parameter files and logs. What a killed launcher left is removed by the next one."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

PREFIX = "robot_formation_run_"
_LOCK = "owner"
_OLD_S = 60.0  # a folder is locked at once after it was made; one that is older and has no lock lost its owner before


@contextlib.contextmanager
def run_folder(parent: Path | None = None) -> Iterator[Path]:
    """Make a folder that is gone at the end; first remove those whose owners are dead.

    The owner keeps a file in it locked (flock): the kernel opens the lock when the owner dies, however that happens,
    and the nodes don't inherit it.

    Args:
        parent: where folders are made; by default where the system keeps temporary files.
    """
    parent = parent or Path(tempfile.gettempdir())
    remove_orphans(parent)
    folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
    try:
        with (folder / _LOCK).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_orphans(parent: Path) -> list[Path]:
    """Remove the folders whose owners are dead; return them. Those that this user may not remove are passed over."""
    removed = []
    for folder in sorted(parent.glob(f"{PREFIX}*")):
        with contextlib.suppress(OSError):
            if folder.is_symlink() or folder.stat().st_uid != os.getuid() or not _abandoned(folder):
                continue
            shutil.rmtree(folder)
            removed.append(folder)
    return removed


def _abandoned(folder: Path) -> bool:
    try:
        lock = (folder / _LOCK).open("r+")
    except FileNotFoundError:
        return time.time() - folder.stat().st_mtime > _OLD_S
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True
