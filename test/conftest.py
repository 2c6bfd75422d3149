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

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

# A middleware reads its profiles once in a process, when a test first joins a graph.
for variable in PROFILES:
    os.environ.setdefault(variable, str(config_dir() / "loopback.xml"))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option with which continuous integration runs."""
    parser.addoption("--retry-graph", action="store_true", help="try tests of the node graph that fail once more")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests of the node graph for pytest-rerunfailures, whose reruns the summary lists (-rR)."""
    if config.getoption("--retry-graph"):
        for item in items:
            if item.get_closest_marker("graph"):
                item.add_marker(pytest.mark.flaky(reruns=1))


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    """A ROS domain of the test's own."""
    from graph_lab import Lab, open_lab

    with open_lab(tmp_path, Lab) as made:
        yield made
