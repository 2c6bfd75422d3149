"""A few seconds of the fuzzer, with a fixed count of cases: nothing crashes, errors are of one line."""

from pathlib import Path

import pytest

from fuzz_detector import Fuzzer, fuzz

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", [11, 12])
def test_random_messages_images_and_files_are_answered_or_refused_in_one_line(tmp_path: Path, seed: int) -> None:
    fuzzer = Fuzzer(seed, tmp_path)
    fuzz(fuzzer, cases=600)
    assert fuzzer.failures == []
    assert sum(fuzzer.outcomes.values()) == 600
    for good in (
        "message answered",
        "message dropped",
        "image_file read",
        "signatures_file read",
        "parameters_file read",
    ):
        assert fuzzer.outcomes[good] > 5
