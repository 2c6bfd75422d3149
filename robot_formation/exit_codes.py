"""Exit codes of the command line and of the nodes."""

from __future__ import annotations

DONE = 0
ERROR = 1
BAD_INPUT = 2
LOST = 3
"""A follower lost its beacon neighbour from view, or a robot left the plate."""
NODE_DIED = 4
INTERRUPTED = 130
