"""A pytest plugin: a test that hangs fails by its name, in Python code and in C code; the others go on.

After `--timeout` seconds pytest-timeout interrupts what runs Python code. C code that doesn't return, perhaps with
Python's lock held (as destroying a node sometimes does, see `nodes/host/signals.py`), hears no signal handler: there
faulthandler's watchdog, which needs no lock, prints the stacks and ends the process. pytest-xdist then names the test
and starts a new process; `crashed_workers` sees to the other tests.

pytest-timeout alone measures a test once: with the first failure it stops, so that what follows, the fixtures' end and
another try (`--retry-graph`), would have no limit.
"""

from __future__ import annotations

import faulthandler
import os

import pytest

GRACE_S = 60.0
"""For how long a test that was interrupted may go on before its process is ended."""
_STDERR = pytest.StashKey[int]()


def pytest_configure(config: pytest.Config) -> None:
    """Keep standard error as it is now: while a test runs, pytest captures it."""
    config.stash[_STDERR] = os.dup(2)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Give it back."""
    faulthandler.cancel_dump_traceback_later()
    os.close(config.stash[_STDERR])


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Limit a test with its fixtures, each try anew."""
    _limit(item)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    """Limit the end of its fixtures."""
    _limit(item)


def pytest_runtest_logfinish() -> None:
    """No limit between tests."""
    faulthandler.cancel_dump_traceback_later()


def _limit(item: pytest.Item) -> None:
    seconds = item.config.getoption("timeout", None)  # unknown without pytest-timeout
    if not seconds:
        return
    from pytest_timeout import Settings

    item.ihook.pytest_timeout_cancel_timer(item=item)
    item.ihook.pytest_timeout_set_timer(item=item, settings=Settings(seconds, "signal", False, False))
    faulthandler.dump_traceback_later(seconds + GRACE_S, exit=True, file=item.config.stash[_STDERR])
