"""Opening files that somebody else named, regular files of a bounded size only; writing files whole; and flushing.

A named pipe would be waited for without end, and a device such as /dev/zero has none.
"""

from __future__ import annotations

import contextlib
import errno
import gc
import io
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

MOST_RECORD_BYTES = 16 << 20
"""Size of the largest file that this project itself writes beside bags and tables."""

MOST_LINE_CHARACTERS = 20_000
"""Length of the longest line of a table."""

_KINDS = (
    (stat.S_ISDIR, errno.EISDIR, "Is a directory"),
    (stat.S_ISFIFO, errno.EINVAL, "Is a named pipe, not a file"),
    (stat.S_ISCHR, errno.EINVAL, "Is a device, not a file"),
    (stat.S_ISBLK, errno.EINVAL, "Is a device, not a file"),
    (stat.S_ISSOCK, errno.EINVAL, "Is a socket, not a file"),
)


_OPEN_FILE = io.IOBase.__base__ or io.IOBase
"""Base of all open files without the hooks of an abstract class, which may fail at classes from outside."""


def flush_open_files() -> None:
    """Write what open files still hold that a class from outside has left open. Compressed ones stay without their end.

    For where such files are not closed in good order: in a process that leaves without Python's end, and before an
    object that holds one goes in a cycle of references, of which Python may close the raw file before its buffer.
    Frozen objects are left out.
    """
    for thing in gc.get_objects():
        if issubclass(type(thing), _OPEN_FILE):
            with contextlib.suppress(Exception, SystemExit):  # closed, a full disk, or a class from outside again
                thing.flush()


def open_file(path: str | Path) -> BinaryIO:
    """Open a regular file for reading, in binary form.

    Raises:
        OSError: if it can't be opened, or is a directory, a named pipe, a device or a socket.
    """
    try:
        # A named pipe without a writer would block here.
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except ValueError as error:  # a NUL in its name
        raise OSError(errno.EINVAL, "No such file", str(path)) from error
    try:
        mode = os.fstat(descriptor).st_mode
        for is_kind, number, text in _KINDS:
            if is_kind(mode):
                raise OSError(number, text, str(path))
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def check_file(path: str | Path) -> None:
    """Check what a library is about to open by name.

    Raises:
        OSError: as for `open_file`.
    """
    open_file(path).close()


def read_file(path: str | Path, most_bytes: int) -> bytes:
    """Read a regular file whole.

    Raises:
        OSError: as for `open_file`, or if the file is larger than `most_bytes`.
    """
    with open_file(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"File is larger than {size_text(most_bytes)}", str(path))
    return content


def whole_lines(path: str | Path) -> Iterator[str]:
    """Read a table's lines with their ends, without a last one that was cut off: half a number is a number too.

    Raises:
        OSError: as for `open_file`.
        ValueError: if it is no UTF-8 text, or has a line that is too long.
    """
    with io.TextIOWrapper(open_file(path), encoding="utf-8", newline="") as file:
        number = 0
        while line := file.readline(MOST_LINE_CHARACTERS + 1):
            number += 1
            if len(line) > MOST_LINE_CHARACTERS:
                raise ValueError(f"line {number} has more than {MOST_LINE_CHARACTERS} characters")
            if line.endswith("\n"):
                yield line


def check_writable(path: Path) -> None:
    """Check that a file can be written, before the work that makes its content.

    Raises:
        OSError: there is no place for it.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "Is a directory", str(path))
    with unfinished_file(path):
        pass


@contextlib.contextmanager
def unfinished_file(path: Path) -> Iterator[Path]:
    """Make a file beside the one that is to be, which is gone at the end unless it has been renamed.

    Raises:
        OSError: it can't be written.
    """
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        unfinished.touch()
        yield unfinished
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file, or leave an older one there as it is.

    Raises:
        OSError: it can't be written.
    """
    with unfinished_file(path) as unfinished:
        unfinished.write_bytes(content)
        unfinished.replace(path)


def size_text(size_bytes: int) -> str:
    """Write a number of bytes for people."""
    for unit, size in (("GiB", 2**30), ("MiB", 2**20), ("KiB", 2**10)):
        if size_bytes >= size:
            return f"{size_bytes / size:.1f} {unit}"
    return f"{size_bytes} B"
