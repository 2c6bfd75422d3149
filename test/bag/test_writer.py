"""What BagWriter writes is what rosbag2 of ROS 2 Jazzy writes, and readers of two other makes agree."""

import errno
import json
import os
import signal
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat

from repository import ROOT
from robot_formation.bag.definitions import definition
from robot_formation.bag.errors import BagError
from robot_formation.bag.qos import TopicQos, dump_profiles, parse_profiles
from robot_formation.bag.recover import recover
from robot_formation.bag.writer import BagWriter
from synthetic_bag import STORE, pose_with_covariance, text

STRING = "std_msgs/msg/String"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
INFINITE = QosTime(9223372036, 854775807)


def cdr(message: Any) -> bytes:
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))


def write_sample(path: Path, **options: Any) -> Path:
    with BagWriter(path, **options) as writer:
        writer.add_topic("/words", STRING, TopicQos(history="keep_all", depth=0))
        writer.add_topic("/pose", POSE, TopicQos(durability="transient_local", depth=1))
        writer.add_topic("/silent", "tf2_msgs/msg/TFMessage", TopicQos())
        writer.write_metadata("robot_formation", {"scenario": "track two"})
        for number in range(10):
            writer.write("/words", cdr(text(f"word {number}")), 1000 + number)
            writer.write("/pose", cdr(pose_with_covariance(number, 0.1 * number, 0.2)), 1000 + number)
            if number % 3 == 2:
                writer.end_chunk()
    return path


def write_by_rosbags(path: Path) -> Path:
    def qos(history: Any, depth: int, durability: Any) -> list[Any]:
        reliable = QosReliability.RELIABLE
        automatic = QosLiveliness.AUTOMATIC
        return [Qos(history, depth, reliable, durability, INFINITE, INFINITE, automatic, INFINITE, False)]

    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        words = writer.add_connection(
            "/words",
            STRING,
            typestore=STORE,
            offered_qos_profiles=qos(QosHistory.KEEP_ALL, 0, QosDurability.VOLATILE),
        )
        poses = writer.add_connection(
            "/pose",
            POSE,
            typestore=STORE,
            offered_qos_profiles=qos(QosHistory.KEEP_LAST, 1, QosDurability.TRANSIENT_LOCAL),
        )
        writer.add_connection(
            "/silent",
            "tf2_msgs/msg/TFMessage",
            typestore=STORE,
            offered_qos_profiles=qos(QosHistory.KEEP_LAST, 10, QosDurability.VOLATILE),
        )
        for number in range(10):
            writer.write(words, 1000 + number, cdr(text(f"word {number}")))
            writer.write(poses, 1000 + number, cdr(pose_with_covariance(number, 0.1 * number, 0.2)))
    return path


def information(bag: Path) -> Any:
    return yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def test_rosbags_reads_topics_types_stamps_and_payload(tmp_path: Path) -> None:
    with AnyReader([write_sample(tmp_path / "run")]) as reader:
        read: list[tuple[str, int, Any]] = [
            (c.topic, stamp, reader.deserialize(data, c.msgtype)) for c, stamp, data in reader.messages()
        ]
        assert {c.topic for c in reader.connections} == {"/words", "/pose", "/silent"}
    words = [(stamp, message.data) for topic, stamp, message in read if topic == "/words"]
    assert words == [(1000 + n, f"word {n}") for n in range(10)]
    forward = [message.pose.pose.position.x for topic, _, message in read if topic == "/pose"]
    assert forward == [0.1 * n for n in range(10)]


def test_the_mcap_reader_finds_profile_schemas_channel_metadata_and_records(tmp_path: Path) -> None:
    path = write_sample(tmp_path / "run") / "run_0.mcap"
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert {s.name: s.encoding for s in summary.schemas.values()} == {
            STRING: "ros2msg",
            POSE: "ros2msg",
            "tf2_msgs/msg/TFMessage": "ros2msg",
        }
        assert all(c.message_encoding == "cdr" for c in summary.channels.values())
        channel = next(c for c in summary.channels.values() if c.topic == "/pose")
        assert channel.metadata["topic_type_hash"] == STORE.hash_rihs01(POSE)
        (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert profile["durability"] == "transient_local"
        assert [record.name for record in reader.iter_metadata()] == ["robot_formation", "rosbag2"]
        messages = list(reader.iter_messages())
    assert len(messages) == 20
    assert all(message.log_time == message.publish_time for _, _, message in messages)
    assert all(chunk.compression == "zstd" for chunk in summary.chunk_indexes)
    assert len(summary.chunk_indexes) == 4


def test_every_schema_carries_the_types_that_it_is_made_of() -> None:
    body = definition("tf2_msgs/msg/TFMessage").text
    for part in ("geometry_msgs/TransformStamped", "geometry_msgs/Transform", "std_msgs/Header"):
        assert f"{'=' * 80}\nMSG: {part}\n" in body


def test_metadata_yaml_equals_that_of_rosbags_but_for_names_and_distribution(tmp_path: Path) -> None:
    ours = information(write_sample(tmp_path / "run"))
    theirs = information(write_by_rosbags(tmp_path / "reference"))
    assert ours.pop("ros_distro") == "jazzy"
    theirs.pop("ros_distro")
    theirs["relative_file_paths"] = ["run_0.mcap"]
    theirs["files"][0]["path"] = "run_0.mcap"
    assert ours == theirs


def test_the_bags_keys_come_in_rosbag2s_order_and_inside_the_mcap_too(tmp_path: Path) -> None:
    bag = write_sample(tmp_path / "run")
    expected = [
        "version",
        "storage_identifier",
        "duration",
        "starting_time",
        "message_count",
        "topics_with_message_count",
        "compression_format",
        "compression_mode",
        "relative_file_paths",
        "files",
        "custom_data",
        "ros_distro",
    ]
    assert list(information(bag)) == expected
    with (bag / "run_0.mcap").open("rb") as stream:
        record = list(make_reader(stream).iter_metadata())[-1]
    assert yaml.safe_load(record.metadata["serialized_metadata"]) == information(bag)


def test_an_empty_bag_has_rosbag2s_starting_time_and_opens(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/words", STRING, TopicQos())
    assert information(tmp_path / "run")["starting_time"] == {"nanoseconds_since_epoch": 2**63 - 1}
    with AnyReader([tmp_path / "run"]) as reader:
        assert reader.message_count == 0


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_each_compression_is_read_back(tmp_path: Path, compression: str) -> None:
    with AnyReader([write_sample(tmp_path / "run", compression=compression)]) as reader:
        assert reader.message_count == 20


def test_equal_stamps_of_one_topic_get_distinct_log_times_in_order(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        writer.add_topic("/other", STRING, TopicQos())
        for topic, stamp in (("/words", 5), ("/words", 5), ("/other", 5), ("/words", 5), ("/words", 6), ("/words", 2)):
            writer.write(topic, cdr(text(topic)), stamp)
    with (tmp_path / "run" / "run_0.mcap").open("rb") as stream:
        found = [
            (channel.topic, message.log_time, message.publish_time)
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False)
        ]
    assert found == [
        ("/words", 5, 5),
        ("/words", 6, 5),
        ("/other", 5, 5),
        ("/words", 7, 5),
        ("/words", 8, 6),
        ("/words", 2, 2),
    ]


def test_the_bag_is_partial_until_it_is_closed(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "run")
    assert (tmp_path / "run.partial").is_dir()
    assert not (tmp_path / "run").exists()
    assert writer.close() == tmp_path / "run"
    assert writer.close() == tmp_path / "run"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run"]
    with pytest.raises(BagError, match="is closed"):
        writer.end_chunk()


def test_an_exception_in_the_block_still_leaves_a_complete_bag(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "run")
    writer.add_topic("/words", STRING, TopicQos())
    writer.write("/words", cdr(text("hello")), 1)
    with pytest.raises(RuntimeError), writer:
        raise RuntimeError
    assert information(tmp_path / "run")["message_count"] == 1


@pytest.mark.parametrize("taken", ["run", "run.partial"])
def test_nothing_is_overwritten(tmp_path: Path, taken: str) -> None:
    (tmp_path / taken).mkdir()
    with pytest.raises(BagError, match="not overwritten"):
        BagWriter(tmp_path / "run")
    assert [p.name for p in tmp_path.iterdir()] == [taken]


def test_a_path_taken_during_the_run_keeps_the_partial_bag(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "run")
    (tmp_path / "run").mkdir()
    with pytest.raises(BagError, match=r"stays in .*run\.partial"):
        writer.close()
    assert (tmp_path / "run.partial" / "run_0.mcap").exists()


def test_a_parent_that_is_a_file_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BagError, match="can't write the bag: Not a directory") as caught:
        BagWriter(tmp_path / "file" / "run")
    assert "\n" not in str(caught.value)


def test_wrong_topics_stamps_metadata_and_options_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="compression can't be 'gzip'"):
        BagWriter(tmp_path / "run", compression="gzip")
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        with pytest.raises(BagError, match="was added before"):
            writer.add_topic("/words", STRING, TopicQos())
        with pytest.raises(BagError, match="no message type 'std_msgs/msg/Strin'"):
            writer.add_topic("/other", "std_msgs/msg/Strin", TopicQos())
        with pytest.raises(BagError, match="topic '/other' is unknown"):
            writer.write("/other", b"", 0)
        for stamp in (-1, 2**63):
            with pytest.raises(BagError, match="give stamps of 0"):
                writer.write("/words", b"", stamp)
        with pytest.raises(BagError, match="convert seed"):
            writer.write_metadata("robot_formation", {"seed": 3})  # type: ignore[dict-item]
        assert writer.message_count == 0
    with pytest.raises(BagError, match="reliability can't be 'RELIABLE'"):
        TopicQos(reliability="RELIABLE")
    with pytest.raises(BagError, match="depth can't be -1"):
        TopicQos(depth=-1)


def test_counts_are_kept_by_topic(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        writer.add_topic("/silent", STRING, TopicQos())
        writer.write("/words", cdr(text("hello")), 0)
        assert writer.message_counts == {"/words": 1, "/silent": 0}


def test_closed_chunks_survive_sigkill(tmp_path: Path) -> None:
    program = f"""
import os, signal, sys
sys.path[:0] = {[str(ROOT / "test" / "bag"), str(ROOT / "test" / "helpers")]!r}
from test_writer import *
writer = BagWriter({str(tmp_path / "run")!r})
writer.add_topic("/words", STRING, TopicQos())
for number in range(5):
    writer.write("/words", cdr(text("kept")), number)
writer.end_chunk()
writer.write("/words", cdr(text("gone")), 5)
os.kill(os.getpid(), signal.SIGKILL)
"""
    result = subprocess.run([sys.executable, "-c", program], env=os.environ, check=False)
    assert result.returncode == -signal.SIGKILL
    assert recover(tmp_path / "run.partial", tmp_path / "saved").messages == 5


def test_qos_text_makes_a_round_trip_and_old_numbers_are_understood() -> None:
    profiles = (TopicQos(), TopicQos(history="keep_all", depth=0, reliability="best_effort", deadline_ns=5))
    assert parse_profiles(dump_profiles(profiles)) == profiles
    old = yaml.safe_load(dump_profiles(profiles[:1]))
    old[0].update(history=1, reliability=2, durability=1, liveliness=1)
    expected = TopicQos(reliability="best_effort", durability="transient_local")
    assert parse_profiles(yaml.safe_dump(old)) == (expected,)
    assert parse_profiles("") == ()
    for broken in ("[", "- 3", "- {depth: 3}"):
        with pytest.raises(BagError, match="QoS profiles that can't be read"):
            parse_profiles(broken)


@pytest.mark.parametrize("type_name", [STRING, POSE, "nav_msgs/msg/Odometry", "visualization_msgs/msg/Marker"])
def test_type_hashes_equal_those_of_the_ros_distribution(type_name: str) -> None:
    package, _, name = type_name.split("/")
    file = Path(sysconfig.get_path("data")) / "share" / package / "msg" / f"{name}.json"
    if not file.exists():
        pytest.skip("no ROS packages in this environment")
    hashes = json.loads(file.read_text())["type_hashes"]
    assert definition(type_name).type_hash == next(h["hash_string"] for h in hashes if h["type_name"] == type_name)


def test_a_full_disk_is_told_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with BagWriter(tmp_path / "run") as writer:
        monkeypatch.setattr(writer._file, "end_chunk", full)
        with pytest.raises(BagError, match="No space left on device; free space"):
            writer.end_chunk()


def test_a_disk_that_is_full_at_the_beginning_is_left_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("robot_formation.bag.writer.McapFile", full)
    with pytest.raises(BagError, match=r"No space left on device; free space or choose another path$"):
        BagWriter(tmp_path / "run")
    assert list(tmp_path.iterdir()) == []
