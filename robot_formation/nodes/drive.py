"""The `drive` executable; what the node does is in components/drive.py."""

from __future__ import annotations

from robot_formation.nodes.signals import stop_on_signals


def main() -> int:
    """Run the node until it ends."""
    stop_on_signals()
    from robot_formation.nodes.host import main_of

    return main_of("drive")


if __name__ == "__main__":
    raise SystemExit(main())
