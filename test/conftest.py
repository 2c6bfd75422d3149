"""What all tests have in common: the same generated cases in every run, so that a failure is the change's own.

`pytest --hypothesis-profile=default` looks for new cases instead.
"""

import pytest
from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture
def lab(tmp_path):
    """A ROS domain of the test's own."""
    from graph_lab import open_lab

    with open_lab(tmp_path) as made:
        yield made
