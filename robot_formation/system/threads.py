"""Threads of libraries for linear algebra and pictures."""

from __future__ import annotations

from collections.abc import Mapping

_OPENMP = "OMP_NUM_THREADS"
_OTHERS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


def one_thread(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables with which such libraries work in the thread that calls them.

    Our matrices and pictures are small: threads for them cost a short run a twentieth of its time, and other processes
    of the graph or of a sweep the processor that they run on. The user's choice counts: that of OMP_NUM_THREADS for all
    libraries, that of a library's own variable for this one.

    Args:
        environment: in which the user may have chosen. The process must not have imported numpy and OpenCV.
    """
    count = environment.get(_OPENMP, "1")
    return {_OPENMP: count, **{name: environment.get(name, count) for name in _OTHERS}}
