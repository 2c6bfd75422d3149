"""Segments become the blobs that the camera's list of growing blobs, followed literally, gives."""

from collections.abc import Sequence

import numpy as np
import pytest

from robot_formation.vision.pixy2.blobs import Blob, connect
from robot_formation.vision.pixy2.segments import Segments
from vision_literal import connected


def segments(*listed: tuple[int, int, int, int]) -> Segments:
    """Segments (signature, row, start, end) in the order of the scan."""
    return Segments(*np.array(listed, np.int64).reshape(-1, 4).T)


def random_segments(rng: np.random.Generator) -> list[tuple[int, int, int, int]]:
    """Rows of runs, denser or sparser, over part of the picture; some rows are empty."""
    fill, change = rng.uniform(0.05, 0.95), rng.uniform(0.02, 0.5)
    listed = []
    cells = rng.random(158) < fill
    for row in range(int(rng.integers(0, 150)), 207):
        cells = np.where(rng.random(158) < change, rng.random(158) < fill, cells)
        if rng.random() < 0.03:
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[0], cells[: 20 + row // 2], [0]])))
        listed += [(1 + (row + start) % 2, row, start, end) for start, end in edges.reshape(-1, 2).tolist()]
    return listed


def literal(listed: Sequence[tuple[int, int, int, int]], signature: int) -> list[Blob]:
    blobs = connected([(row, start, end) for number, row, start, end in listed if number == signature])
    return [Blob(signature, b["left"], b["right"], b["top"], b["last"][0], b["area"]) for b in blobs]


def test_random_segments_give_the_blobs_of_the_literal_reading() -> None:
    for seed in range(60):
        listed = random_segments(np.random.default_rng(seed))
        found = connect(segments(*listed))
        for signature in (1, 2):
            mine = [blob for blob in found.get(signature, []) if blob.bottom - blob.top > 1]
            theirs = [blob for blob in literal(listed, signature) if blob.bottom - blob.top > 1]
            assert [blob.area for blob in mine] == [blob.area for blob in theirs], f"seed {seed}"
            assert sorted(mine) == sorted(theirs), f"seed {seed}"


def test_no_segments_give_no_blobs() -> None:
    assert connect(segments()) == {}


def test_a_segment_in_the_gap_between_two_arms_of_a_blob_belongs_to_it() -> None:
    arms = [(1, row, start, start + 4) for row in (11, 12, 13) for start in (10, 26)]
    inside = (1, 14, 18, 20)
    (blob,) = connect(segments((1, 10, 10, 30), *arms, inside))[1]
    assert blob == Blob(1, 10, 30, 10, 14, 21 + 6 * 5 + 3)


def test_a_segment_between_two_blobs_is_a_blob_of_its_own() -> None:
    pair = [(1, row, start, start + 4) for row in (11, 12, 13) for start in (10, 26)]
    between = [(1, row, 18, 20) for row in (14, 15, 16)]
    assert [blob.left for blob in connect(segments(*pair, *between))[1]] == [26, 10, 18]


@pytest.mark.parametrize(("end", "count"), [(9, 2), (10, 1)])
def test_touching_by_one_column_connects(end: int, count: int) -> None:
    upper = [(1, row, 5, end) for row in (10, 11, 12)]
    lower = [(1, row, 10, 15) for row in (13, 14, 15)]
    assert len(connect(segments(*upper, *lower))[1]) == count


def test_an_empty_row_separates() -> None:
    assert len(connect(segments(*[(1, row, 5, 9) for row in (10, 11, 12, 14, 15, 16)]))[1]) == 2


def test_blobs_of_equal_area_come_from_the_last_to_end_to_the_first() -> None:
    listed = sorted(
        (1, row, start, start + 4) for start, top in ((10, 20), (30, 25), (50, 20)) for row in (top, top + 1, top + 2)
    )
    assert [blob.left for blob in connect(segments(*listed))[1]] == [30, 50, 10]
    assert connect(segments(*listed))[1] == literal(listed, 1)


def test_flat_blobs_count_only_while_they_may_still_grow() -> None:
    flat, last = [(1, row, 5, 50) for row in (10, 11)], [(1, row, 80, 90) for row in (20, 21)]
    assert [blob.top for blob in connect(segments(*flat, *last))[1]] == [20]
