"""Which message of a bag is due when: rate, pauses, steps, beginning, end, and what transient-local topics hold."""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.bag.errors import BagError
from robot_formation.bag.playback import Playhead, Prefetch, ScheduleErrors, make_excerpt
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import Bag, read_bag
from robot_formation.bag.source import RawMessage
from robot_formation.bag.writer import BagWriter
from synthetic_bag import STORE, text

STRING = "std_msgs/msg/String"
SECOND = 10**9


@given(st.floats(0.01, 100.0), st.integers(0, 10**18), st.floats(0.0, 1e5))
def test_a_message_is_due_after_its_distance_divided_by_the_rate(rate: float, start_ns: int, now_s: float) -> None:
    head = Playhead(rate, start_ns, now_s)
    assert head.wait_s(start_ns + 3 * SECOND, now_s) == pytest.approx(3.0 / rate)
    assert head.time_ns(now_s + 2.0 / rate) == pytest.approx(start_ns + 2 * SECOND, abs=1000)
    assert head.wait_s(start_ns, now_s + 1.0) == pytest.approx(-1.0)


def test_a_pause_stops_bag_time_and_shifts_what_follows() -> None:
    head = Playhead(2.0, 0, 100.0)
    head.pause(True, 101.0)
    assert head.time_ns(150.0) == 2 * SECOND
    assert head.wait_s(0, 150.0) == math.inf
    head.pause(True, 160.0)
    head.pause(False, 200.0)
    assert head.time_ns(201.0) == 4 * SECOND
    assert head.wait_s(8 * SECOND, 201.0) == 2.0


def test_a_step_in_a_pause_takes_bag_time_along() -> None:
    head = Playhead(1.0, 0, 0.0)
    head.pause(True, 1.0)
    head.jump(7 * SECOND, 5.0)
    assert head.time_ns(6.0) == 7 * SECOND
    head.pause(False, 10.0)
    assert head.wait_s(8 * SECOND, 10.0) == 1.0


def test_another_rate_counts_from_now_on_also_in_a_pause() -> None:
    head = Playhead(1.0, 0, 0.0)
    head.set_rate(4.0, 2.0)
    assert head.wait_s(10 * SECOND, 2.0) == 2.0
    head.pause(True, 3.0)
    head.set_rate(1.0, 50.0)
    assert head.time_ns(60.0) == 6 * SECOND
    head.pause(False, 70.0)
    assert head.wait_s(10 * SECOND, 70.0) == 4.0


def test_schedule_errors_are_summarised_honestly() -> None:
    errors = ScheduleErrors()
    assert errors.summary_ms() is None
    for number in range(101):
        errors.add(number * 1e-3)
    assert len(errors) == 101
    assert errors.summary_ms() == pytest.approx({"median_ms": 50.0, "p99_ms": 99.0, "worst_ms": 100.0})


@pytest.fixture
def bag(tmp_path: Path) -> Iterator[Bag]:
    """Words every second from 10 s on; a map at 10, 12 and 14 s that keeps one, and a history that keeps all."""
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        writer.add_topic("/map", STRING, TopicQos(durability="transient_local", depth=1))
        writer.add_topic("/history", STRING, TopicQos(durability="transient_local", history="keep_all", depth=0))
        for second in range(10, 20):
            writer.write("/words", cdr(f"w{second}"), second * SECOND)
            if second in (10, 12, 14):
                writer.write("/map", cdr(f"m{second}"), second * SECOND)
                writer.write("/history", cdr(f"h{second}"), second * SECOND)
    with read_bag(tmp_path / "bag") as opened:
        yield opened


def cdr(words: str) -> bytes:
    return bytes(STORE.serialize_cdr(text(words), STRING))


def said(messages: Iterable[RawMessage]) -> list[str]:
    read: list[Any] = [STORE.deserialize_cdr(message.cdr, STRING) for message in messages]
    return [message.data for message in read]


TOPICS = frozenset(("/words", "/map", "/history"))
LATCHED = {"/map": 1, "/history": 0}


def test_the_whole_bag_is_played_with_transient_local_topics_first(bag: Bag) -> None:
    excerpt = make_excerpt(bag, TOPICS, LATCHED)
    assert sorted(said(excerpt.first(bag))) == ["h10", "m10"]
    scheduled = said(excerpt.scheduled(bag))
    assert [word for word in scheduled if word[0] == "w"] == [f"w{second}" for second in range(10, 20)]
    assert sorted(word for word in scheduled if word[0] != "w") == ["h12", "h14", "m12", "m14"]


def test_a_part_begins_with_what_late_subscribers_would_know(bag: Bag) -> None:
    excerpt = make_excerpt(bag, TOPICS, LATCHED, start_s=3.0, duration_s=2.0)
    assert said(excerpt.first(bag)) == ["h10", "m12", "h12"]
    assert sorted(said(excerpt.scheduled(bag))) == ["h14", "m14", "w13", "w14"]


def test_topics_that_are_not_chosen_are_left_out(bag: Bag) -> None:
    excerpt = make_excerpt(bag, frozenset(["/words"]), {}, start_s=8.0)
    assert said(excerpt.first(bag)) == []
    assert said(excerpt.scheduled(bag)) == ["w18", "w19"]


def test_a_beginning_behind_the_end_is_refused(bag: Bag) -> None:
    with pytest.raises(BagError, match=r"9\.000 s long: it can't be played from 9\.5 s on"):
        make_excerpt(bag, TOPICS, LATCHED, start_s=9.5)


def test_messages_are_read_ahead_in_order_to_the_end() -> None:
    source = [RawMessage("/words", STRING, number, bytes(number % 50)) for number in range(5000)]
    with Prefetch(iter(source)) as prefetch:
        found = []
        while (message := prefetch.next()) is not None:
            found.append(message)
        assert prefetch.next() is None
    assert found == source


def test_reading_ahead_can_be_given_up_and_tells_what_is_damaged() -> None:
    endless = (RawMessage("/words", STRING, number, b"") for number in iter(int, 1))
    with Prefetch(endless) as prefetch:
        assert prefetch.next() is not None

    def damaged() -> Iterator[RawMessage]:
        yield RawMessage("/words", STRING, 0, b"")
        raise BagError("damaged")

    with Prefetch(damaged()) as prefetch:
        assert prefetch.next() is not None
        with pytest.raises(BagError, match="damaged"):
            prefetch.next()
