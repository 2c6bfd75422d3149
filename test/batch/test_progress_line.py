"""The line that tells how far a batch of work is."""

import pytest

from robot_formation.batch.progress_line import with_progress


def test_progress_passes_rows_on_and_tells_the_last_always(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(with_progress(iter("abc"), 3)) == ["a", "b", "c"]
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("3/3 runs, ")
