"""Tests of one group run in one process, whatever pytest and pytest-xdist are installed."""

import re
from pathlib import Path

import pytest

from inner_pytest import run_pytest

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
    result = run_pytest(tmp_path, "-v", "-n", "2", "--dist", "loadgroup")
    assert "24 passed" in result.stdout, result.stdout + result.stderr
    ran = re.findall(r"^\[(gw\d)\] .* PASSED (\S+)", result.stdout, re.MULTILINE)
    assert len({process for process, test in ran if "test_one" in test}) == 1
    assert len({process for process, test in ran}) == 2
