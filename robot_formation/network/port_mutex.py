"""The mutex under which Fast DDS opens and closes a port in shared memory: a named POSIX semaphore."""

from __future__ import annotations

import ctypes
import os
from types import TracebackType

_RIGHTS = 0o666  # what Fast DDS gives it


class PortMutex:
    """A port's mutex as a context manager that gives whether it could be taken at once; made where there is none.

    Args:
        port: the port's file in shared memory, "fastrtps_port7001" say.

    Raises:
        OSError: on entering, if it can't be opened: another user's, say.
    """

    def __init__(self, port: str) -> None:
        self._name = f"/{port}_mutex".encode()
        library = ctypes.CDLL(None, use_errno=True)
        self._open, self._close = library.sem_open, library.sem_close
        self._try, self._post = library.sem_trywait, library.sem_post
        self._open.restype = ctypes.c_void_p
        for function in (self._close, self._try, self._post):
            function.argtypes = [ctypes.c_void_p]
        self._semaphore: int | None = None
        self._taken = False

    def __enter__(self) -> bool:
        self._semaphore = self._open(self._name, os.O_CREAT, _RIGHTS, 1)
        if self._semaphore is None:  # SEM_FAILED, a null pointer
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number), self._name.decode())
        self._taken = self._try(self._semaphore) == 0
        return self._taken

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._taken:
            self._post(self._semaphore)
        self._close(self._semaphore)
