"""The `progress` executable; what the node does is in following.py."""

from __future__ import annotations

from robot_formation.nodes.signals import stop_on_signals


def main() -> int:
    """Run the node until it ends."""
    stop_on_signals()
    from robot_formation.nodes.following import Executable
    from robot_formation.nodes.host import run_node

    return run_node("progress", Executable)


if __name__ == "__main__":
    raise SystemExit(main())
