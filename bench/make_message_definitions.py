"""Write the definitions of the messages on the project's topics into the package, as rosbags' type store has them.

`robot_formation/bag/message_definitions.json` spares a recorder the loading of that store. A test says when the file
lacks a type or differs.

Run: python bench/make_message_definitions.py
"""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path

from robot_formation import names
from robot_formation.bag.definitions import DEFINITIONS_FILE, looked_up


def types() -> list[str]:
    """List the types that `names` speaks of."""
    return sorted(set(re.findall(r'"(\w+/msg/\w+)"', Path(names.__file__).read_text(encoding="utf-8"))))


def as_json() -> str:
    """Return what the file should hold."""
    kept = {found.type_name: (found.text, found.type_hash) for found in map(looked_up, types())}
    return json.dumps(kept, indent=1) + "\n"


def main() -> int:
    """Write the file."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    DEFINITIONS_FILE.write_text(as_json(), encoding="utf-8")
    print(DEFINITIONS_FILE)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
