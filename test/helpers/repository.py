"""Where things of the repository lie, for tests in any folder."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "robot_formation"
BENCH = ROOT / "bench"
DATA = ROOT / "test" / "data"
HELPERS = ROOT / "test" / "helpers"
