"""The `block_detector` executable; what the node does is in components/block_detector.py."""

from __future__ import annotations

from robot_formation.nodes.host import main_of


def main() -> int:
    """Run the node until it ends."""
    return main_of("block_detector")


if __name__ == "__main__":
    raise SystemExit(main())
