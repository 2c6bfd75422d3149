"""A pytest plugin: tests of one group (xdist_group) run in one process, with pytest 9.2 too.

With `--dist loadgroup` pytest-xdist 3.8 adds the group to the id of a test, by which its scheduler knows it. It does so
in an attribute that pytest 9.2 doesn't read any more, so that groups are ignored without a word (pytest-xdist issue
1386). Fixtures of a module are then made in every process, and tests that must not run at the same time may do so.
"""

import pytest


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Make the id that pytest-xdist has given a test the one that pytest tells."""
    for item in items:
        given = getattr(item, "_nodeid", item.nodeid)
        if given != item.nodeid:
            item._id = type(item.id).parse(given)
