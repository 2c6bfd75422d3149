"""The `fine_tuner` executable; what the node does is in components/fine_tuner.py."""

from __future__ import annotations

from robot_formation.nodes.host import main_of


def main() -> int:
    """Run the node until it ends."""
    return main_of("fine_tuner")


if __name__ == "__main__":
    raise SystemExit(main())
