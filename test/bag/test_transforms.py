"""/tf and /tf_static in a run's bag, and what a bag without true poses has instead."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag2

from graph_tools import short_scenario
from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import Recorder
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import BagMessage, read_bag
from robot_formation.bag.transforms import Transforms
from robot_formation.experiment.in_process import run_in_process
from robot_formation.launching.processes import run_metadata
from robot_formation.world.description import robot_description
from robot_formation.world.parameters import WorldParameters
from synthetic_bag import STORE, odometry, text

pytestmark = pytest.mark.xdist_group("bag_transforms")

ODOMETRY, STRING = "nav_msgs/msg/Odometry", "std_msgs/msg/String"


def cdr(message: Any) -> bytes:
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))


def decoded(messages: Iterable[Any]) -> list[tuple[str, Any, int]]:
    return [
        (topic.name, STORE.deserialize_cdr(data, "tf2_msgs/msg/TFMessage"), stamp_ns)
        for topic, data, stamp_ns in messages
    ]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scenario = short_scenario("leader.timesteps=1")
    path = tmp_path_factory.mktemp("tf") / "bag"
    run_in_process(scenario, path, run_metadata(scenario))
    return path


def messages_of(bag: Path, *topics: str) -> list[BagMessage]:
    with read_bag(bag) as opened:
        return list(opened.messages(topics))


def test_every_true_pose_of_a_run_is_a_transform_of_its_time(bag: Path) -> None:
    poses = messages_of(bag, "/ground_truth/leader/odom", "/ground_truth/follower_1/odom")
    transforms = messages_of(bag, "/tf")

    def key(header: Any, child: str, place: Any, turn: Any) -> tuple[float | str, ...]:
        return (header.stamp.sec, header.stamp.nanosec, child, place.x, place.y, place.z, turn.z, turn.w)

    expected = [
        key(p.message.header, p.message.child_frame_id, p.message.pose.pose.position, p.message.pose.pose.orientation)
        for p in poses
    ]
    found = []
    for message in transforms:
        (entry,) = message.message.transforms
        assert entry.header.frame_id == "world"
        found.append(key(entry.header, entry.child_frame_id, entry.transform.translation, entry.transform.rotation))
        stamp_ns = entry.header.stamp.sec * 10**9 + entry.header.stamp.nanosec
        assert 0 <= message.stamp_ns - stamp_ns < 1000
    assert len(expected) > 20
    assert sorted(found) == sorted(expected)


def test_the_fixed_frames_are_one_message_at_the_start_and_make_one_tree(bag: Path) -> None:
    (message,) = messages_of(bag, "/tf_static")
    assert message.stamp_ns == 0
    parents = {entry.child_frame_id: entry.header.frame_id for entry in message.message.transforms}
    assert len(parents) == len(message.message.transforms)
    assert parents["follower_1/camera_optical_frame"] == "follower_1/camera_link"
    assert parents["leader/marker"] == "leader/base_link"
    assert "leader/camera_link" not in parents
    parents |= {f"{robot}/base_link": "world" for robot in ("leader", "follower_1")}
    for frame in parents:
        while frame != "world":
            frame = parents[frame]
    for entry in message.message.transforms:
        q = entry.transform.rotation
        assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(1.0)


def test_a_reader_of_another_make_finds_type_and_latched_qos(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        found = {connection.topic: connection for connection in reader.connections}
        assert found["/tf"].msgtype == found["/tf_static"].msgtype == "tf2_msgs/msg/TFMessage"
        static = found["/tf_static"].ext
        assert isinstance(static, ConnectionExtRosbag2)
        assert static.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"


def test_the_robots_start_is_its_odom_frame() -> None:
    made = Transforms()
    for stamp_ns, x in ((0, 0.5), (10**9, 0.7)):
        message = odometry(stamp_ns, x, 0.2, 0.3)
        message.child_frame_id = "leader/base_link"
        made.take("/ground_truth/leader/odom", ODOMETRY, cdr(message), stamp_ns)
    (_, first, _), (_, second, late), (name, static, early) = decoded(made.make())
    assert [m.transforms[0].transform.translation.x for m in (first, second)] == [0.5, 0.7]
    assert (name, late, early) == ("/tf_static", 10**9, 0)
    (odom,) = static.transforms
    assert (odom.header.frame_id, odom.child_frame_id) == ("world", "leader/odom")
    assert odom.transform.translation.x == 0.5
    assert list(made.make()) == []


def odometry_cdr(stamp_ns: int, x_m: float, child: str, order: str = "little") -> bytes:
    message = odometry(stamp_ns, x_m, 0.2, 0.3)
    message.child_frame_id = child
    return bytes(STORE.serialize_cdr(message, ODOMETRY, little_endian=order == "little"))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (odometry_cdr(3, 0.1, "leader/base_link"), odometry_cdr(7 * 10**9 + 5, -0.4, "leader/base_link")),
        (odometry_cdr(3, 0.1, "leader/base_link"), odometry_cdr(4, 0.2, "another/base_link")),
        (odometry_cdr(3, 0.1, "leader/base_link"), odometry_cdr(4, 0.2, "leader/base_lind")),
        (odometry_cdr(3, 0.1, "leader/base_link"), odometry_cdr(4, 0.2, "leader/base_link", "big")),
        (odometry_cdr(3, 0.1, "leader/base_link", "big"), odometry_cdr(4, 0.2, "leader/base_link", "big")),
        (odometry_cdr(3, math.nan, "leader"), odometry_cdr(4, math.inf, "leader")),
    ],
    ids=["the same frames", "a longer frame", "a frame of the same length", "another order", "big", "no numbers"],
)
def test_a_transform_made_like_the_one_before_is_as_if_it_were_the_first(first: bytes, second: bytes) -> None:
    def made(*messages: bytes) -> list[bytes]:
        transforms = Transforms()
        for message in messages:
            transforms.take("/ground_truth/leader/odom", ODOMETRY, message, 0)
        return [found.cdr for found in transforms.make() if found.topic.name == "/tf"]

    assert made(first, second) == [*made(first), *made(second)]


def test_a_pose_that_is_cut_off_is_left_out_behind_a_whole_one() -> None:
    whole = odometry_cdr(3, 0.1, "leader/base_link")
    transforms = Transforms()
    for message in (whole, whole[:-8], whole[:40], b"\0\1", whole):
        transforms.take("/ground_truth/leader/odom", ODOMETRY, message, 0)
    assert len([found for found in transforms.make() if found.topic.name == "/tf"]) == 2


def test_fixed_frames_that_come_later_are_told_with_all_others() -> None:
    made = Transforms()
    description = robot_description("leader", WorldParameters(), camera=True)
    made.take("/leader/robot_description", STRING, cdr(text(description)), 0)
    ((_, first, _),) = decoded(made.make())
    made.take("/ground_truth/leader/odom", ODOMETRY, cdr(odometry(5, 0.1, 0.2, 0.3)), 5)
    _, (_, second, stamp_ns) = decoded(made.make())
    assert len(second.transforms) == len(first.transforms) + 1
    assert stamp_ns == 5


def test_other_topics_and_texts_that_are_no_urdf_give_nothing() -> None:
    made = Transforms()
    made.take("/leader/odom", ODOMETRY, cdr(odometry(0, 1.0, 0.0, 0.0)), 0)
    made.take("/leader/alignment", STRING, cdr(text("<robot/>")), 0)
    made.take("/leader/robot_description", STRING, cdr(text("no xml")), 0)
    made.take("/follower_1/robot_description", STRING, cdr(text("<robot><joint/></robot>")), 0)
    assert list(made.make()) == []


def test_transforms_that_somebody_publishes_are_left_alone(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "bag", {})
    recorder.add_topic("/tf", "tf2_msgs/msg/TFMessage", TopicQos())
    recorder.add_topic("/ground_truth/leader/odom", ODOMETRY, TopicQos())
    recorder.record("/ground_truth/leader/odom", ODOMETRY, cdr(odometry(0, 1.0, 0.0, 0.0)))
    recorder.close()
    assert messages_of(tmp_path / "bag", "/tf") == []
    assert len(messages_of(tmp_path / "bag", "/tf_static")) == 1


def test_a_closed_chunk_has_its_transforms(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "bag", {})
    recorder.add_topic("/ground_truth/leader/odom", ODOMETRY, TopicQos())
    recorder.record("/ground_truth/leader/odom", ODOMETRY, cdr(odometry(0, 1.0, 0.0, 0.0)))
    recorder.end_chunk()
    assert len(messages_of(tmp_path / "bag.partial", "/tf")) == 1
    recorder.close()


def test_a_publisher_that_appears_while_transforms_are_made_is_recorded_beside_them(tmp_path: Path) -> None:
    foreign = STORE.types["tf2_msgs/msg/TFMessage"]([])
    with_robot = Recorder(tmp_path / "bag", {})
    with_robot.add_topic("/ground_truth/leader/odom", ODOMETRY, TopicQos())
    with_robot.record("/ground_truth/leader/odom", ODOMETRY, cdr(odometry(10**9, 1.0, 0.0, 0.0)))
    with_robot.end_chunk()
    with_robot.add_topic("/tf", "tf2_msgs/msg/TFMessage", TopicQos())
    with_robot.record("/tf", "tf2_msgs/msg/TFMessage", cdr(foreign))
    with_robot.record("/ground_truth/leader/odom", ODOMETRY, cdr(odometry(2 * 10**9, 1.0, 0.0, 0.0)))
    with_robot.close()
    found = [[entry.child_frame_id for entry in m.message.transforms] for m in messages_of(tmp_path / "bag", "/tf")]
    assert sorted(found) == [[], ["base_link"], ["base_link"]]


def test_a_topic_of_the_recorders_own_keeps_its_type(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "bag", {})
    recorder.add_topic("/ground_truth/leader/odom", ODOMETRY, TopicQos())
    recorder.record("/ground_truth/leader/odom", ODOMETRY, cdr(odometry(10**9, 1.0, 0.0, 0.0)))
    recorder.end_chunk()
    with pytest.raises(BagError, match="added before"):
        recorder.add_topic("/tf", STRING, TopicQos())
    recorder.close()


def test_poses_that_cannot_be_decoded_give_no_transforms(tmp_path: Path) -> None:
    with_robot = Recorder(tmp_path / "bag", {})
    with_robot.add_topic("/ground_truth/leader/odom", ODOMETRY, TopicQos())
    for data in (b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + b"\xff" * 40):
        with_robot.record("/ground_truth/leader/odom", ODOMETRY, data, 5)
    with_robot.close()
    with read_bag(tmp_path / "bag") as opened:
        assert [message.topic for message in opened.raw_messages(opened.topics)] == ["/ground_truth/leader/odom"] * 2


def test_a_topic_of_another_type_that_was_there_first_keeps_its_messages(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "bag", {})
    recorder.add_topic("/tf", STRING, TopicQos())
    recorder.add_topic("/ground_truth/leader/odom", ODOMETRY, TopicQos())
    recorder.record("/ground_truth/leader/odom", ODOMETRY, cdr(odometry(10**9, 1.0, 0.0, 0.0)))
    recorder.close()
    assert messages_of(tmp_path / "bag", "/tf") == []


def test_each_formations_transforms_lie_in_its_namespace() -> None:
    made = Transforms()
    for namespace, x in (("", 0.1), ("/site_a", 0.2)):
        message = odometry(0, x, 0.2, 0.3)
        message.child_frame_id = "leader/base_link"
        made.take(f"{namespace}/ground_truth/leader/odom", ODOMETRY, cdr(message), 0)
    places = {name: message.transforms[0].transform.translation.x for name, message, _ in decoded(made.make())}
    assert places == {"/tf": 0.1, "/site_a/tf": 0.2, "/tf_static": 0.1, "/site_a/tf_static": 0.2}
