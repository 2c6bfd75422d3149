"""Cases that a test goes through in a loop."""

import contextlib
from collections.abc import Iterator

import pytest


@contextlib.contextmanager
def case(*names: object) -> Iterator[None]:
    """Name the case in the message of whatever fails within."""
    try:
        yield
    except (Exception, pytest.fail.Exception) as error:
        raise AssertionError(f"case {', '.join(map(str, names))}: {error}") from error
