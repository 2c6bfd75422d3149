"""What all tests have in common: the same generated cases in every run, so that a failure is the change's own.

`pytest --hypothesis-profile=default` looks for new cases instead.
"""

import os

import pytest
from hypothesis import settings

# Warnings are errors in the processes that tests start, too, and files left open are warned of. The development mode's
# checks of memory are left out: they are about C code, and slow.
for name, value in {"PYTHONDEVMODE": "1", "PYTHONMALLOC": "default", "PYTHONWARNINGS": "error"}.items():
    os.environ.setdefault(name, value)

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture
def lab(tmp_path):
    """A ROS domain of the test's own."""
    from graph_lab import open_lab

    with open_lab(tmp_path) as made:
        yield made
