"""A bag is split by size or by log time, and its parts are one bag again for readers of every make."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from robot_formation.bag.errors import BagError
from robot_formation.bag.info import bag_info
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recover import recover
from robot_formation.bag.write_options import WriteOptions
from robot_formation.bag.writer import BagWriter
from synthetic_bag import STORE, text

STRING = "std_msgs/msg/String"
SECOND = 10**9


def cdr(words: str) -> bytes:
    return bytes(STORE.serialize_cdr(text(words), STRING))


def write(path: Path, options: WriteOptions, count: int = 24, size: int = 1000) -> Path:
    with BagWriter(path, options=options) as writer:
        writer.add_topic("/words", STRING, TopicQos(history="keep_all", depth=0))
        writer.write_metadata("robot_formation", {"seed": "3"})
        for number in range(count):
            writer.write("/words", cdr(f"{number:04d}" * (size // 4)), number * SECOND)
            if number == count // 2:
                writer.add_topic("/late", STRING, TopicQos())
                writer.write("/late", cdr("late"), number * SECOND)
            writer.end_chunk()
    return path


def information(bag: Path) -> Any:
    return yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


SPLITS = [
    (WriteOptions(split_ns=2 * SECOND), 8),
    (WriteOptions(compression="none", split_bytes=12_000), 3),
    (WriteOptions(), 1),
]


@pytest.mark.parametrize(("options", "files"), SPLITS)
def test_the_parts_are_counted_and_timed_in_the_metadata(tmp_path: Path, options: WriteOptions, files: int) -> None:
    found = information(write(tmp_path / "run", options))
    names = [f"run_{number}.mcap" for number in range(files)]
    assert found["relative_file_paths"] == [file["path"] for file in found["files"]] == names
    assert found["message_count"] == sum(file["message_count"] for file in found["files"]) == 25
    assert found["starting_time"]["nanoseconds_since_epoch"] == 0
    assert found["duration"]["nanoseconds"] == 23 * SECOND
    ends = [
        (file["starting_time"]["nanoseconds_since_epoch"], file["duration"]["nanoseconds"]) for file in found["files"]
    ]
    assert ends == sorted(ends)
    assert sum(duration for _, duration in ends) + (files - 1) * SECOND == 23 * SECOND


@pytest.mark.parametrize(("options", "files"), SPLITS)
def test_readers_of_other_makes_and_ours_see_one_bag(tmp_path: Path, options: WriteOptions, files: int) -> None:
    bag = write(tmp_path / "run", options)
    with AnyReader([bag]) as reader:
        theirs = [(c.topic, stamp) for c, stamp, _ in reader.messages()]
    with read_bag(bag) as ours:
        assert [(m.topic, m.stamp_ns) for m in ours.raw_messages(ours.topics)] == theirs
        assert ours.metadata("robot_formation") == {"seed": "3"}
        assert [(topic.name, topic.message_count) for topic in ours.contents] == [("/late", 1), ("/words", 24)]
    assert [stamp // SECOND for topic, stamp in theirs if topic == "/words"] == list(range(24))
    assert bag_info(bag).files == tuple(f"run_{number}.mcap" for number in range(files))


def test_every_part_can_be_read_alone(tmp_path: Path) -> None:
    bag = write(tmp_path / "run", WriteOptions(split_ns=2 * SECOND))
    for file in sorted(bag.glob("*.mcap")):
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            assert [record.name for record in reader.iter_metadata()] == ["robot_formation", "rosbag2"]
            assert all(schema is not None and schema.data for schema, _, _ in reader.iter_messages())
        with read_bag(file) as part:
            assert part.metadata("robot_formation") == {"seed": "3"}


def test_a_split_bag_that_was_cut_off_is_recovered_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    bag = write(tmp_path / "run", WriteOptions(split_ns=1), count=12)
    partial = tmp_path / "cut.partial"
    bag.rename(partial)
    (partial / "metadata.yaml").unlink()
    last = partial / "run_11.mcap"
    last.write_bytes(last.read_bytes()[:200])
    report = recover(partial, tmp_path / "saved")
    assert not report.complete
    assert (report.first_stamp_ns, report.last_stamp_ns) == (0, 10 * SECOND)
    with (tmp_path / "saved" / "saved_0.mcap").open("rb") as stream:
        stamps = [
            m.log_time for _, c, m in make_reader(stream).iter_messages(log_time_order=False) if c.topic == "/words"
        ]
    assert stamps == [number * SECOND for number in range(11)]


def test_what_an_option_cannot_be_is_told(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="compression can't be 'gzip'"):
        BagWriter(tmp_path / "run", options=WriteOptions(compression="gzip"))
    assert list(tmp_path.iterdir()) == []


def test_a_full_chunk_is_ended_by_itself_and_survives(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "run", options=WriteOptions(chunk_bytes=4096))
    writer.add_topic("/words", STRING, TopicQos())
    for number in range(10):
        writer.write("/words", cdr("x" * 1000), number)
    assert writer.open_bytes < 5000
    dead = tmp_path / "dead.mcap"
    (written,) = writer.partial_path.glob("*.mcap")
    dead.write_bytes(written.read_bytes())
    writer.discard()
    assert list(tmp_path.iterdir()) == [dead]
    assert recover(dead, tmp_path / "saved").messages == 8
