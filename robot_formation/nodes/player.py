"""The `player` executable; what the node does is in playing.py."""

from __future__ import annotations

from robot_formation.nodes.signals import stop_on_signals


def main() -> int:
    """Run the node until it ends."""
    stop_on_signals()
    from robot_formation.nodes.host import run_node
    from robot_formation.nodes.playing import Executable

    return run_node("player", Executable)


if __name__ == "__main__":
    raise SystemExit(main())
