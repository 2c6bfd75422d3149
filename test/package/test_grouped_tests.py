"""Tests of one group run in one process, whatever pytest and pytest-xdist are installed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from repository import HELPERS

PLAIN = ("-p", "no:launch_testing", "-p", "no:launch_ros", "-p", "no:cacheprovider")
TESTS = """
import pytest

@pytest.mark.xdist_group("together")
@pytest.mark.parametrize("number", range(6))
def test_one(number): pass

@pytest.mark.parametrize("number", range(6))
def test_other(number): pass
"""


def test_a_group_is_not_shared_out(tmp_path: Path) -> None:
    pytest.importorskip("xdist")
    (tmp_path / "conftest.py").write_text('pytest_plugins = ("grouped_tests",)\n')
    for name in ("these", "those"):
        (tmp_path / f"test_{name}.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text(f"[pytest]\npythonpath = {HELPERS}\n")
    command = [sys.executable, "-m", "pytest", *PLAIN, "-v", "-n", "2", "--dist", "loadgroup"]
    environment = {name: text for name, text in os.environ.items() if not name.startswith("PYTEST_")}
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
    assert "24 passed" in result.stdout, result.stdout + result.stderr
    ran = re.findall(r"^\[(gw\d)\] .* PASSED (\S+)", result.stdout, re.MULTILINE)
    assert len({process for process, test in ran if "test_one" in test}) == 1
    assert len({process for process, test in ran}) == 2
