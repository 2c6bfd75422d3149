"""Runs of pytest within a test, on test files of its own, with plugins from test/helpers."""

import os
import subprocess
import sys
from pathlib import Path

from repository import HELPERS

_PLAIN = ("-p", "no:launch_testing", "-p", "no:launch_ros", "-p", "no:cacheprovider")


def run_pytest(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of a folder, which may import the helpers; what pytest's own process sets is not handed on."""
    (folder / "pytest.ini").write_text(f"[pytest]\npythonpath = {HELPERS}\n")
    environment = {name: text for name, text in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-m", "pytest", *_PLAIN, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
