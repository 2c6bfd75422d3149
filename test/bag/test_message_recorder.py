"""The recorder finds each message's simulated time and keeps what it has written when it dies."""

import struct
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from robot_formation import conversions
from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import METADATA_NAME, Recorder, own_stamp
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import Bag, read_bag
from robot_formation.bag.recover import recover
from robot_formation.geometry.se2 import Motion
from synthetic_bag import STORE

POSE, STRING, TICK = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/String", "std_msgs/msg/UInt32"
SECOND = 10**9


def pose(stamp_ns: int) -> bytes:
    return conversions.to_cdr(conversions.move(Motion(0.1), "base_link", stamp_ns))


def tick(number: int) -> bytes:
    return conversions.to_cdr(conversions.uint32(number))


def big_endian(seconds: int, nanoseconds: int, rest: bytes = b"") -> bytes:
    return b"\x00\x00\x00\x00" + struct.pack(">iI", seconds, nanoseconds) + rest


def little_endian(seconds: int, nanoseconds: int, rest: bytes = b"") -> bytes:
    return b"\x00\x01\x00\x00" + struct.pack("<iI", seconds, nanoseconds) + rest


def recorder_with(path: Path, *types: tuple[str, str], metadata: dict[str, str] | None = None) -> Recorder:
    found = Recorder(path, metadata or {})
    for topic, type_name in types:
        found.add_topic(topic, type_name, TopicQos(history="keep_all", depth=0))
    return found


def times(path: Path) -> list[tuple[str, int, int]]:
    """Topic, log time and publish time of each message in a bag's file, as the mcap library reads it."""
    (file,) = path.glob("*.mcap")
    with file.open("rb") as stream:
        found = make_reader(stream).iter_messages()
        return sorted((channel.topic, message.log_time, message.publish_time) for _, channel, message in found)


# --- the stamp inside a message ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("type_name", "message"),
    [
        ("rosgraph_msgs/msg/Clock", conversions.clock(5 * SECOND + 7)),
        ("sensor_msgs/msg/JointState", conversions.joint_states(["a"], [1.0], [2.0], 5 * SECOND + 7)),
        ("geometry_msgs/msg/PoseStamped", conversions.move(Motion(), "base_link", 5 * SECOND + 7)),
        ("sensor_msgs/msg/PointCloud2", conversions.blocks([], "camera", 5 * SECOND + 7)),
        ("nav_msgs/msg/Path", conversions.path([], "world", 5 * SECOND + 7)),
        ("diagnostic_msgs/msg/DiagnosticArray", conversions.diagnostics("n", 0, "ok", {}, 5 * SECOND + 7)),
        ("std_msgs/msg/Header", conversions.header(5 * SECOND + 7)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_types_that_begin_with_a_time_have_their_own_stamp(type_name: str, message: Any) -> None:
    assert own_stamp(type_name, conversions.to_cdr(message)) == 5 * SECOND + 7


# A list of stamped messages (TFMessage) has no time of its own.
@pytest.mark.parametrize("type_name", [STRING, TICK, "std_msgs/msg/Empty", "tf2_msgs/msg/TFMessage"])
def test_types_without_a_time_at_their_beginning_have_none(type_name: str) -> None:
    assert own_stamp(type_name, little_endian(5, 7, bytes(40))) is None


def test_a_stamp_is_read_in_both_byte_orders() -> None:
    for order in (little_endian, big_endian):
        assert own_stamp(POSE, order(1_700_000_000, 123_456_789, bytes(80))) == 1_700_000_000_123_456_789


def test_both_byte_orders_as_rosbags_serialises_them() -> None:
    clock = STORE.types["rosgraph_msgs/msg/Clock"](STORE.types["builtin_interfaces/msg/Time"](258, 77))
    for little in (True, False):
        data = bytes(STORE.serialize_cdr(clock, "rosgraph_msgs/msg/Clock", little_endian=little))
        assert own_stamp("rosgraph_msgs/msg/Clock", data) == 258 * SECOND + 77


def test_a_negative_time_is_no_simulated_time() -> None:
    for order in (little_endian, big_endian):
        assert own_stamp(POSE, order(-1, 5)) is None


@pytest.mark.parametrize("length", [0, 3, 4, 8, 11])
def test_a_message_too_short_for_a_time_has_none(length: int) -> None:
    assert own_stamp(POSE, little_endian(5, 7)[:length]) is None


# --- what is written --------------------------------------------------------------------------------------------------


def test_messages_get_their_own_stamp_or_the_latest_one_seen_before_them(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/pose", POSE), ("/tick", TICK))
    recorder.record("/tick", TICK, tick(0))  # before any time is known
    recorder.record("/pose", POSE, pose(3 * SECOND))
    recorder.record("/tick", TICK, tick(1))
    recorder.record("/pose", POSE, pose(2 * SECOND))  # a latecomer keeps its stamp and doesn't turn time back
    recorder.record("/tick", TICK, tick(2))
    recorder.record("/pose", POSE, pose(4 * SECOND))
    recorder.record("/tick", TICK, tick(3))
    path = recorder.close()
    published = {topic: [p for t, _, p in times(path) if t == topic] for topic in ("/pose", "/tick")}
    assert published["/pose"] == [2 * SECOND, 3 * SECOND, 4 * SECOND]
    assert published["/tick"] == [0, 3 * SECOND, 3 * SECOND, 4 * SECOND]


def test_log_times_of_a_topic_differ_so_that_players_keep_the_order(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/pose", POSE), ("/tick", TICK))
    recorder.record("/pose", POSE, pose(SECOND))
    for number in range(5):
        recorder.record("/tick", TICK, tick(number))
    path = recorder.close()
    assert [log for topic, log, _ in times(path) if topic == "/tick"] == [SECOND + n for n in range(5)]
    with read_bag(path) as bag:
        assert [message.message.data for message in bag.messages(["/tick"])] == [0, 1, 2, 3, 4]


def test_messages_come_back_as_they_were(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/pose", POSE))
    message = conversions.move(Motion(0.123, -0.045, 0.3), "follower_1/base_link", 5)
    recorder.record("/pose", POSE, conversions.to_cdr(message))
    with read_bag(recorder.close()) as bag:
        ((_, _, _, found),) = bag.messages(["/pose"])
    assert found.header.frame_id == "follower_1/base_link"
    assert (found.pose.position.x, found.pose.position.y) == (0.123, -0.045)
    assert found.pose.orientation.z == message.pose.orientation.z


def test_metadata_and_counts_are_kept(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/tick", TICK), metadata={"scenario": "two", "seed": "3"})
    assert recorder.topics == {"/tick"}
    for number in range(3):
        recorder.record("/tick", TICK, tick(number))
    assert recorder.message_count == 3
    with read_bag(recorder.close()) as bag:
        assert bag.metadata(METADATA_NAME) == {"scenario": "two", "seed": "3"}


def test_a_topic_must_be_declared_and_its_type_known(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag")
    with pytest.raises(BagError, match="topic '/tick' is unknown"):
        recorder.record("/tick", TICK, tick(0))
    with pytest.raises(BagError):
        recorder.add_topic("/odd", "nobody_msgs/msg/Knows", TopicQos())
    recorder.close()


def test_a_bag_that_is_there_is_not_overwritten(tmp_path: Path) -> None:
    recorder_with(tmp_path / "bag").close()
    with pytest.raises(BagError, match="is not overwritten"):
        Recorder(tmp_path / "bag", {})


# --- death ------------------------------------------------------------------------------------------------------------


def dead_copy(recorder_path: Path, target: Path) -> Path:
    """What a killed recorder leaves on the disk: its unclosed file."""
    partial = recorder_path.with_name(recorder_path.name + ".partial")
    dead = target.with_name(target.name + ".partial")
    dead.mkdir()
    for file in partial.iterdir():
        (dead / file.name).write_bytes(file.read_bytes())
    return dead


def ticks_in(bag: Bag) -> list[int]:
    return [message.message.data for message in bag.messages(["/tick"])]


def test_what_came_before_the_end_of_a_chunk_survives_a_file_that_is_never_closed(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/tick", TICK), metadata={"seed": "3"})
    for number in range(5):
        recorder.record("/tick", TICK, tick(number))
    recorder.end_chunk()
    for number in range(5, 8):
        recorder.record("/tick", TICK, tick(number))
    dead = dead_copy(tmp_path / "bag", tmp_path / "dead")
    with read_bag(dead) as bag:
        assert bag.recovered
        assert ticks_in(bag) == [0, 1, 2, 3, 4]
        assert bag.metadata(METADATA_NAME)["seed"] == "3"
    recorder.close()
    with read_bag(tmp_path / "bag") as bag:
        assert not bag.recovered
        assert ticks_in(bag) == list(range(8))


def test_large_messages_close_their_chunks_by_themselves(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/words", STRING), ("/tick", TICK))
    recorder.record("/tick", TICK, tick(0))
    recorder.record("/words", STRING, conversions.to_cdr(conversions.string("x" * (1 << 20))))
    dead = dead_copy(tmp_path / "bag", tmp_path / "dead")
    with read_bag(dead) as bag:
        assert ticks_in(bag) == [0]
        assert bag.topics["/words"] == STRING
    recorder.close()


def test_ending_a_chunk_without_messages_writes_nothing(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/tick", TICK))
    (file,) = (tmp_path / "bag.partial").glob("*.mcap")
    before = file.stat().st_size
    recorder.end_chunk()
    recorder.end_chunk()
    assert file.stat().st_size == before
    recorder.record("/tick", TICK, tick(0))
    recorder.end_chunk()
    assert file.stat().st_size > before
    recorder.close()
    with read_bag(tmp_path / "bag") as bag:
        assert ticks_in(bag) == [0]


def test_a_recovered_recording_is_a_bag_like_any_other(tmp_path: Path) -> None:
    recorder = recorder_with(tmp_path / "bag", ("/tick", TICK), ("/pose", POSE))
    recorder.record("/pose", POSE, pose(SECOND))
    recorder.record("/tick", TICK, tick(0))
    recorder.end_chunk()
    dead = dead_copy(tmp_path / "bag", tmp_path / "dead")
    recover(dead, tmp_path / "whole")
    recorder.close()
    assert times(tmp_path / "whole") == times(tmp_path / "bag")
