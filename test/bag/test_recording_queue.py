"""The queue before the disk keeps order, tells what it drops and what goes wrong, and never makes its user wait."""

import threading
from pathlib import Path

import pytest

from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import Recorder
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recording_queue import RecordingQueue
from synthetic_bag import STORE, text

STRING = "std_msgs/msg/String"


def cdr(words: str) -> bytes:
    return bytes(STORE.serialize_cdr(text(words), STRING))


def words_in(path: Path) -> list[str]:
    with read_bag(path) as bag:
        return [message.message.data for message in bag.messages(["/words"])]


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    return Recorder(tmp_path / "bag", {})


def test_messages_and_actions_keep_their_order(recorder: Recorder) -> None:
    queue = RecordingQueue(recorder)
    queue.call(lambda: recorder.add_topic("/words", STRING, TopicQos()))
    assert all(queue.put("/words", STRING, cdr(f"{number}")) for number in range(200))
    queue.finish()
    assert queue.waiting_bytes == 0
    assert not queue.dropped
    assert words_in(recorder.close()) == [f"{number}" for number in range(200)]


def test_what_does_not_fit_is_dropped_and_counted_by_topic(recorder: Recorder) -> None:
    recorder.add_topic("/words", STRING, TopicQos())
    queue = RecordingQueue(recorder, queue_bytes=1000)
    disk = threading.Event()
    queue.call(disk.wait)
    taken = [queue.put("/words", STRING, cdr("x" * 300)) for _ in range(5)]
    assert taken == [True, True, True, False, False]
    assert queue.dropped == {"/words": 2}
    assert 900 < queue.most_waiting_bytes <= 1000
    disk.set()
    queue.finish()
    assert len(words_in(recorder.close())) == 3


def test_a_message_larger_than_the_queue_goes_in_alone(recorder: Recorder) -> None:
    recorder.add_topic("/words", STRING, TopicQos())
    queue = RecordingQueue(recorder, queue_bytes=1000)
    assert queue.put("/words", STRING, cdr("x" * 5000))
    queue.finish()
    assert len(words_in(recorder.close())) == 1


def test_after_an_error_on_the_disk_nothing_is_taken_and_whoever_asks_is_told(recorder: Recorder) -> None:
    queue = RecordingQueue(recorder)
    queue.put("/unknown", STRING, cdr("x"))
    queue.stop()
    assert not queue.put("/words", STRING, cdr("x"))
    queue.call(lambda: pytest.fail("called"))
    assert not queue.dropped
    with pytest.raises(BagError, match="'/unknown' is unknown"):
        queue.check()
    with pytest.raises(BagError, match="'/unknown' is unknown"):
        queue.finish()
    recorder.close()


def test_a_defect_ends_the_recording_and_is_named(recorder: Recorder) -> None:
    queue = RecordingQueue(recorder)
    queue.call(lambda: 1 / 0)
    with pytest.raises(BagError, match="the recorder failed: ZeroDivisionError"):
        queue.finish()
    recorder.close()
