"""Blocks appear late, vanish late, keep their index, and are answered as the camera answers."""

from collections.abc import Sequence

import pytest

from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_tracking import ALL_BLOCKS, ALL_SIGNATURES, ClockError, Tracker
from robot_formation.vision.pixy2.boxes import Box

PERIOD_60 = 16_200
PERIOD_30 = 33_333


def box(x: int = 100, y: int = 80, signature: int = 1, size: int = 40) -> Box:
    return Box(signature, x - size // 2, x + size // 2, y - size // 2, y + size // 2)


def step(tracker: Tracker, boxes: list[Box], time_us: int) -> list[Block]:
    """Reported blocks after a frame."""
    tracker.step(boxes, time_us)
    return tracker.answer(ALL_SIGNATURES, ALL_BLOCKS)


def frames(tracker: Tracker, sequence: Sequence[list[Box]], period_us: int) -> list[list[Block]]:
    """Reported blocks after each frame of a sequence of box lists."""
    return [step(tracker, boxes, number * period_us) for number, boxes in enumerate(sequence)]


@pytest.mark.parametrize(
    ("filtering", "period_us", "first"), [(0, PERIOD_60, 1), (3, PERIOD_60, 4), (40, PERIOD_30, 20)]
)
def test_a_block_is_reported_after_the_block_filtering(filtering: int, period_us: int, first: int) -> None:
    reported = frames(Tracker(filtering, 65), [[box()]] * 25, period_us)
    assert [bool(blocks) for blocks in reported] == [number >= first for number in range(25)]
    assert [blocks[0].age for blocks in reported[first:]] == list(range(25 - first))


def test_a_lost_block_stays_frozen_for_half_the_filtering_and_keeps_aging() -> None:
    reported = frames(Tracker(40, 65), [[box()]] * 21 + [[]] * 12, PERIOD_30)
    kept = [blocks[0] for blocks in reported[20:] if blocks]
    # Lost at frame 21; 320 ticks (327.7 ms) later it is gone: ten frames.
    assert len(kept) == 1 + 10
    assert {(block.x, block.y) for block in kept} == {(100, 80)}
    assert [block.age for block in kept] == list(range(11))
    assert reported[31] == []


def test_a_block_found_again_in_time_keeps_its_index() -> None:
    tracker = Tracker(3, 65)
    reported = frames(tracker, [[box()]] * 5 + [[]] + [[box(x=110)]] * 2, PERIOD_60)
    assert [(blocks[0].x, blocks[0].index, blocks[0].age) for blocks in reported[4:]] == [
        (100, 0, 0),
        (100, 0, 1),
        (110, 0, 2),
        (110, 0, 3),
    ]


@pytest.mark.parametrize(("period_us", "largest"), [(PERIOD_60, 91), (PERIOD_30, 131)])
def test_a_jump_beyond_the_velocity_gate_makes_a_new_track(period_us: int, largest: int) -> None:
    for jump, index in ((largest, 0), (largest + 1, 1)):
        tracker = Tracker(0, 65)
        frames(tracker, [[box(x=60)]] * 2 + [[box(x=60 + jump)]], period_us)
        assert step(tracker, [box(x=60 + jump)], 3 * period_us)[0].index == index


def test_a_candidate_that_never_validates_uses_up_an_index() -> None:
    reported = frames(Tracker(3, 65), [[box(signature=2)], [], *[[box()]] * 6], PERIOD_60)
    assert reported[-1][0].index == 1


def test_indices_wrap_after_255() -> None:
    tracker = Tracker(0, 10)
    jumping = [[box(x=60 if number % 2 else 250)] for number in range(257)]
    frames(tracker, [*jumping, jumping[-1]], PERIOD_60)
    assert step(tracker, jumping[-1], 258 * PERIOD_60)[0].index == 0


def test_two_blocks_that_cross_keep_the_nearer_track() -> None:
    tracker = Tracker(0, 65)
    frames(tracker, [[box(x=50), box(x=150)]] * 2, PERIOD_60)
    blocks = step(tracker, [box(x=140), box(x=60)], 2 * PERIOD_60)
    assert [(block.index, block.x) for block in blocks] == [(0, 60), (1, 140)]


def test_an_established_track_takes_its_box_from_a_dearer_owner() -> None:
    tracker = Tracker(0, 320)
    frames(tracker, [[box(x=50), box(x=100)]] * 2, PERIOD_60)
    # The first track is served first and takes the only box; the second is nearer and evicts it.
    blocks = step(tracker, [box(x=98)], 2 * PERIOD_60)
    assert [(block.index, block.x) for block in blocks] == [(1, 98)]


def test_the_age_stops_at_255() -> None:
    assert frames(Tracker(0, 65), [[box()]] * 300, PERIOD_60)[-1][0].age == 255


def test_ticks_may_wrap_while_a_block_is_waiting() -> None:
    tracker = Tracker(40, 65)
    wrap_us = (1 << 16) << 10
    tracker.step([], 0)
    reported = [step(tracker, [box()], wrap_us - 10 * PERIOD_30 + n * PERIOD_30) for n in range(21)]
    assert [bool(blocks) for blocks in reported] == [False] * 20 + [True]


@pytest.mark.parametrize("second_us", [500, 400])
def test_a_frame_that_is_not_later_is_refused(second_us: int) -> None:
    tracker = Tracker(0, 65)
    tracker.step([], 500)
    with pytest.raises(ClockError, match="not later"):
        tracker.step([], second_us)


def test_reset_starts_the_clock_and_the_indices_anew() -> None:
    tracker = Tracker(0, 65)
    frames(tracker, [[box()]] * 3, PERIOD_60)
    tracker.reset()
    assert frames(tracker, [[box()]] * 2, PERIOD_60)[-1][0].index == 0


def seen(boxes: list[Box]) -> Tracker:
    """A tracker that reports these boxes."""
    tracker = Tracker(0, 65)
    frames(tracker, [boxes] * 2, PERIOD_60)
    return tracker


def test_get_blocks_answers_the_first_eighteen_tracks_largest_first() -> None:
    tracker = seen([Box(1, 10 * number, 10 * number + number, 0, 10) for number in range(30)])
    assert [b.index for b in tracker.answer(0xFF, 255)] == list(range(17, -1, -1))
    assert [b.index for b in tracker.answer(0xFF, 2)] == [17, 16]
    assert tracker.answer(0xFF, 0) == []


def test_get_blocks_selects_signatures_and_codes_by_bit() -> None:
    tracker = seen([box(signature=number) for number in (1, 3, 7, 10)])
    assert [b.signature for b in tracker.answer(0b101, 255)] == [1, 3]
    assert [b.signature for b in tracker.answer(0x80, 255)] == [10]
    assert [b.signature for b in tracker.answer(0x40, 255)] == [7]
