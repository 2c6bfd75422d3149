"""Keeps memory of pictures in the process: new pages from the system cost more than drawing a picture."""

from __future__ import annotations

import numpy as np

_LARGEST_KEPT_BYTES = 31 << 20
"""A little below glibc's own limit of 32 MB."""


def keep_freed_memory() -> None:
    """Make the C library reuse freed blocks of up to 31 MB.

    glibc gives large blocks back to the system as soon as they are freed. What it takes for large grows with the
    largest block that has been freed (mallopt(3), M_MMAP_THRESHOLD and M_TRIM_THRESHOLD). The pages of a block that is
    never written are not even taken. The first run of a process with ten followers takes 26 thousand page faults with
    this and 459 thousand without; they were 1.3 of its 10.8 s. Other C libraries are not changed by it.
    """
    np.empty(_LARGEST_KEPT_BYTES, np.uint8)
