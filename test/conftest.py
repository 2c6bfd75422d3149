"""What all tests have in common: the same generated cases in every run, so that a failure is the change's own.

`pytest --hypothesis-profile=default` looks for new cases instead.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from robot_formation.network.loopback import PROFILES
from robot_formation.paths import config_dir

if TYPE_CHECKING:  # it imports rclpy
    from graph_lab import Lab

pytest_plugins = ("hanging_tests", "crashed_workers", "grouped_tests")

MOST_ID = 100
"""How many characters of a value an id shows: as in pytest 9. Older ones have no limit; a picture had 40 million."""

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

# A middleware reads its profiles once in a process, when a test first joins a graph.
for variable in PROFILES:
    os.environ.setdefault(variable, str(config_dir() / "loopback.xml"))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option with which continuous integration runs."""
    parser.addoption("--retry-graph", action="store_true", help="try tests that start processes and fail once more")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests that start processes for pytest-rerunfailures, whose reruns the summary lists (-rR)."""
    if config.getoption("--retry-graph"):
        for item in items:
            if item.get_closest_marker("graph") or _starts_processes(item):
                item.add_marker(pytest.mark.flaky(reruns=1))


def _starts_processes(item: pytest.Item) -> bool:
    return isinstance(item, pytest.Function) and hasattr(item.module, "subprocess")


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Let an id name the argument where its value is long."""
    return argname if isinstance(val, str | bytes) and len(val) > MOST_ID else None


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    """A ROS domain of the test's own."""
    from graph_lab import Lab, open_lab

    with open_lab(tmp_path, Lab) as made:
        yield made
