"""Tests that hang or end their process fail by their names, and no other test is lost."""

import re
from pathlib import Path

import pytest

from inner_pytest import run_pytest

pytestmark = pytest.mark.long

CONFTEST = """
import hanging_tests
hanging_tests.GRACE_S = 1.0
pytest_plugins = ("hanging_tests", "crashed_workers")
"""
TESTS = """
import ctypes, os, pathlib, time
import pytest

def hang_with_the_lock():
    mutex = ctypes.create_string_buffer(64)
    libc = ctypes.PyDLL(None)
    libc.pthread_mutex_lock(mutex)
    libc.pthread_mutex_lock(mutex)

def first(name):
    log = pathlib.Path(__file__).with_name(name)
    told = log.exists()
    log.touch()
    return not told

@pytest.fixture
def endless():
    yield
    time.sleep(1000)

@pytest.mark.xdist_group("one")
def test_before(): pass
@pytest.mark.xdist_group("one")
def test_in_c(): hang_with_the_lock()
@pytest.mark.xdist_group("one")
def test_after(): pass
def test_in_python(): time.sleep(1000)
def test_that_dies(): os._exit(1)
def test_whose_fixture_does_not_end(endless): assert False
@pytest.mark.flaky(reruns=1)
def test_in_c_once():
    if first("c"): hang_with_the_lock()
@pytest.mark.flaky(reruns=1)
def test_in_python_once():
    if first("python"): time.sleep(1000)
@pytest.mark.flaky(reruns=1)
def test_in_python_twice(): time.sleep(1000)
@pytest.mark.parametrize("number", range(3))
def test_other(number): pass
"""


@pytest.mark.parametrize("cores", [1, 2])
def test_each_fails_by_its_name_and_all_others_are_run(tmp_path: Path, cores: int) -> None:
    for module in ("xdist", "pytest_timeout", "pytest_rerunfailures"):
        pytest.importorskip(module)
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_these.py").write_text(TESTS)
    result = run_pytest(tmp_path, "-rA", "-n", str(cores), "--dist", "loadgroup", "--timeout", "2")
    ended: dict[str, set[str]] = {outcome: set() for outcome in ("FAILED", "PASSED", "ERROR")}
    for outcome, name in re.findall(
        r"^(FAILED|PASSED|ERROR) test_these.py::(\w+(?:\[\d\])?)", result.stdout, re.MULTILINE
    ):
        ended[outcome].add(name)
    assert ended["FAILED"] == {
        "test_in_c",
        "test_in_python",
        "test_that_dies",
        "test_whose_fixture_does_not_end",
        "test_in_python_twice",
    }, result.stdout + result.stderr
    assert ended["ERROR"] == {"test_whose_fixture_does_not_end"}
    others = {f"test_other[{number}]" for number in range(3)}
    assert ended["PASSED"] == {"test_before", "test_after", "test_in_c_once", "test_in_python_once", *others}
    assert "hang_with_the_lock" in result.stderr  # the stacks say where


def test_processes_that_die_after_their_last_test_fail_the_run(tmp_path: Path) -> None:
    pytest.importorskip("xdist")
    dying = "import os\ndef pytest_sessionfinish(session):\n    if 'PYTEST_XDIST_WORKER' in os.environ: os._exit(9)\n"
    (tmp_path / "conftest.py").write_text(f'pytest_plugins = ("crashed_workers",)\n{dying}')
    (tmp_path / "test_these.py").write_text("def test_one(): pass\ndef test_two(): pass\n")
    result = run_pytest(tmp_path, "-n", "2", "--dist", "loadgroup")
    assert "2 passed" in result.stdout
    assert result.returncode != 0
