"""PyBullet, imported without the greeting that it prints on standard error, which would spoil the command line's."""

from __future__ import annotations

import os
import sys

sys.stderr.flush()
_kept = os.dup(2)
_nowhere = os.open(os.devnull, os.O_WRONLY)
os.dup2(_nowhere, 2)
try:
    import pybullet
finally:
    os.dup2(_kept, 2)
    os.close(_kept)
    os.close(_nowhere)

__all__ = ["pybullet"]
