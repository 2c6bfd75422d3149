"""Threads of libraries for linear algebra and pictures."""

from __future__ import annotations

from collections.abc import MutableMapping

_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


def use_one_thread(environment: MutableMapping[str, str]) -> None:
    """Let such libraries work in the thread that calls them, unless the user has chosen a number of threads.

    Our matrices and pictures are small: threads for them cost a short run a twentieth of its time, and other processes
    of the graph or of a sweep the processor that they run on. Takes effect in a process that hasn't imported numpy and
    OpenCV, and in those that it starts.

    Args:
        environment: of the process.
    """
    for name in _COUNTS:
        environment.setdefault(name, "1")
