"""Lost messages, counted by the gaps in sequence numbers, against publishers whose losses are known."""

import random

import pytest

from robot_formation.bag.losses import LossCounter


def count(numbers: list[int], publishers: int = 1) -> list[int]:
    counter = LossCounter()
    return [counter.take(number, publishers) for number in numbers]


def test_a_gap_counts_as_many_messages_as_are_missing() -> None:
    assert count([1, 2, 3, 7, 8, 10]) == [0, 0, 0, 3, 0, 1]


def test_whoever_subscribes_late_has_lost_nothing() -> None:
    assert count([57, 58]) == [0, 0]


def test_a_publisher_that_starts_again_has_lost_nothing() -> None:
    assert count([1, 2, 3, 1, 2, 4]) == [0, 0, 0, 0, 0, 0]
    assert sum(count([1, 2, 3, 1, 2, 3, 4, 6])) == 1


def test_a_second_publisher_that_is_heard_first_far_ahead_has_lost_nothing() -> None:
    assert count([1, 2, 90, 3, 91, 4], publishers=2) == [0] * 6


@pytest.mark.parametrize("seed", range(5))
def test_the_sum_over_publishers_heard_in_any_order_is_exact(seed: int) -> None:
    random_source = random.Random(seed)
    streams = [list(range(first, first + 300)) for first in (1, 1, 40)]
    lost = 0
    for stream in streams:
        # The first and the last number stay: what is missing before or after them cannot be seen.
        for number in random_source.sample(stream[1:-1], 30):
            stream.remove(number)
            lost += 1
    arrivals = [stream.pop(0) for stream in streams]
    while any(streams):
        arrivals.append(random_source.choice([stream for stream in streams if stream]).pop(0))
    assert sum(count(arrivals, publishers=3)) == lost


def test_publishers_that_come_and_go_take_no_memory() -> None:
    counter = LossCounter()
    for _ in range(1000):
        for number in (3, 2, 1):
            assert counter.take(number, 1) == 0
    assert len(counter._last) <= 64
