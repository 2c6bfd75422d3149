"""`python -m robot_formation.nodes NAME ...`: an executable by its name, where it isn't installed as a command."""

from __future__ import annotations

import sys

from robot_formation import exit_codes
from robot_formation.nodes import executables

NAMES = (
    *("world", "overhead_tracker", "drive", "block_detector", "predictor", "fine_tuner", "leader"),
    *("recorder", "player", "progress", "viewer"),
)


def main() -> int:
    """Run the executable that the first argument names; the others are the node's."""
    name = sys.argv.pop(1) if len(sys.argv) > 1 else ""
    if name not in NAMES:
        print(f"usage: python -m robot_formation.nodes NAME [...]; names: {', '.join(NAMES)}", file=sys.stderr)
        return exit_codes.BAD_INPUT
    return int(getattr(executables, name)())


if __name__ == "__main__":
    raise SystemExit(main())
