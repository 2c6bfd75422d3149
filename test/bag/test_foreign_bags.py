"""Bags of other makes, incomplete, packed or hostile ones: read completely, or refused in one line."""

import json
import os
import shutil
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
import zstandard
from rosbags.rosbag2 import StoragePlugin, Writer

from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.from_bag import load_displacements, load_run
from robot_formation.bag import mcap_chunks
from robot_formation.bag.errors import BagError
from robot_formation.bag.info import bag_info, info_text
from robot_formation.bag.playback import make_excerpt
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recover import recover
from robot_formation.bag.source import RawMessage
from robot_formation.bag.transforms import Transforms
from robot_formation.bag.writer import BagWriter
from robot_formation.cli.main import main
from robot_formation.errors import MOST_CHARACTERS
from synthetic_bag import STORE, Step, SyntheticRun, text

STRING = "std_msgs/msg/String"
MOVED = "/follower_1/moved"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A bag of a short run, as its folder."""
    with BagWriter(tmp_path / "run") as writer:
        made = SyntheticRun(writer)
        for _ in range(3):
            made.step(Step(residual=(0.001, 0.0)))
    return tmp_path / "run"


def edit_metadata(bag: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change a bag's metadata.yaml."""
    path = bag / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    change(content["rosbag2_bagfile_information"])
    path.write_text(yaml.safe_dump(content, sort_keys=False))


def raw(bag: Path) -> list[RawMessage]:
    """All messages of a bag."""
    with read_bag(bag) as opened:
        return list(opened.raw_messages(opened.topics))


def as_sqlite(bag: Path, target: Path) -> Path:
    """Write a bag's messages into an SQLite bag of rosbags; return its database."""
    with read_bag(bag) as opened, Writer(target, version=9, storage_plugin=StoragePlugin.SQLITE3) as out:
        there = {name: out.add_connection(name, kind, typestore=STORE) for name, kind in opened.topics.items()}
        for message in opened.raw_messages(opened.topics):
            out.write(there[message.topic], message.stamp_ns, message.cdr)
    return target / f"{target.name}.db3"


def refused(function: Callable[..., object], *arguments: object) -> str:
    """Return the one line with which a bag is refused."""
    with pytest.raises(BagError) as raised:
        function(*arguments)
    said = str(raised.value)
    assert len(said) <= MOST_CHARACTERS
    assert said.isprintable()
    return said


def test_a_reindexed_bag_is_read_completely(run: Path, tmp_path: Path) -> None:
    whole = raw(run)

    def as_reindex_writes(information: dict[str, Any]) -> None:
        for topic in information["topics_with_message_count"]:
            for profile in topic["topic_metadata"]["offered_qos_profiles"]:
                profile.update(depth=10, history="unknown")

    edit_metadata(run, as_reindex_writes)
    assert raw(run) == whole
    assert bag_info(run).warnings == ()
    assert len(load_run(run).followers[0].displacements) == 3


def test_metadata_that_count_other_messages_are_told(run: Path, caplog: pytest.LogCaptureFixture) -> None:
    def one_more(information: dict[str, Any]) -> None:
        topic = next(t for t in information["topics_with_message_count"] if t["topic_metadata"]["name"] == MOVED)
        topic["message_count"] += 1

    edit_metadata(run, one_more)
    info = bag_info(run)
    assert f"counts 5 messages on '{MOVED}', the bag's files hold 4" in info.warnings[0]
    assert info.to_mapping()["warnings"] == list(info.warnings)
    assert info.warnings[0] in info_text(info)
    caplog.clear()
    load_run(run)
    assert "reindex" in caplog.text


def test_a_bag_that_holds_less_than_its_index_says_is_refused_while_it_is_read(run: Path) -> None:
    (file,) = run.glob("*.mcap")
    data = bytearray(file.read_bytes())
    footer = len(data) - 8 - 29
    at = struct.unpack_from("<Q", data, footer + 9)[0]
    while data[at] != 0x0B:  # the statistics
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    channel_counts = at + 9 + 42 + 4
    (count,) = struct.unpack_from("<Q", data, channel_counts + 2)
    struct.pack_into("<Q", data, channel_counts + 2, count + 7)
    struct.pack_into("<I", data, footer + 25, 0)
    file.write_bytes(data)
    assert f"says that it holds {count + 7} messages" in refused(raw, run)
    with read_bag(run) as bag:
        excerpt = make_excerpt(bag, frozenset(bag.topics), {})
        assert f"says that it holds {count + 7} messages" in refused(list, excerpt.scheduled(bag))


@pytest.mark.parametrize("storage", ["mcap", "sqlite"])
def test_bags_that_rosbag2_compressed_file_by_file_are_read(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, storage: str
) -> None:
    whole = raw(run)
    if storage == "sqlite":
        as_sqlite(run, tmp_path / "other")
        run = tmp_path / "other"
    file = next(path for path in run.iterdir() if path.suffix in (".mcap", ".db3"))
    packed = file.with_name(f"{file.name}.zstd")
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()

    def as_rosbag2_writes(information: dict[str, Any]) -> None:
        information.update(compression_format="zstd", compression_mode="FILE", relative_file_paths=[packed.name])

    edit_metadata(run, as_rosbag2_writes)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    assert raw(run) == whole
    assert raw(packed) == whole
    assert bag_info(run).compression == "zstd (file)"
    for path in (run, packed):
        assert "compressed as a whole" in refused(recover, path, tmp_path / "saved") or storage == "sqlite"
    packed.write_bytes(packed.read_bytes()[:-20])
    assert str(run) in refused(raw, run)
    assert list(scratch.iterdir()) == []


def test_bags_whose_messages_were_compressed_one_by_one_are_read(run: Path, tmp_path: Path) -> None:
    whole = raw(run)
    target = tmp_path / "single"
    with BagWriter(target) as writer:
        for topic in {message.topic: message.type_name for message in whole}.items():
            writer.add_topic(*topic, ())
        for message in whole:
            writer.write(message.topic, zstandard.compress(message.cdr), message.stamp_ns, log_time_ns=message.stamp_ns)
    edit_metadata(target, lambda information: information.update(compression_format="zstd", compression_mode="MESSAGE"))
    assert raw(target) == whole
    edit_metadata(target, lambda information: information.update(compression_format="lzma"))
    assert "compressed as 'lzma'" in refused(raw, target)


def test_a_file_without_chunks_is_read(tmp_path: Path) -> None:
    from mcap.writer import Writer as McapWriter

    path = tmp_path / "loose.mcap"
    writer = McapWriter(str(path), use_chunking=False)
    writer.start(profile="ros2")
    schema = writer.register_schema(STRING, "ros2msg", b"string data")
    channel = writer.register_channel("/words", "cdr", schema, {})
    for stamp in (3, 5, 5, 9):
        writer.add_message(channel, stamp, bytes(STORE.serialize_cdr(text(f"at {stamp}"), STRING)), stamp)
    writer.finish()
    with read_bag(path) as bag:
        assert [(m.stamp_ns, m.message.data) for m in bag.messages({"/words"})] == [
            (stamp, f"at {stamp}") for stamp in (3, 5, 5, 9)
        ]
        assert [m.stamp_ns for m in bag.raw_messages({"/words"}, 5, 9)] == [5, 5]


def test_equal_stamps_keep_the_order_of_their_writing_over_chunks(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        for topic in ("/a", "/b"):
            writer.add_topic(topic, STRING, ())
        for number in range(40):
            cdr = bytes(STORE.serialize_cdr(text(str(number)), STRING))
            writer.write("/ab"[0] + "ab"[number % 2], cdr, number // 4, log_time_ns=number // 4)
            if number % 7 == 6:
                writer.end_chunk()
    with read_bag(tmp_path / "bag") as bag:
        assert [m.message.data for m in bag.messages({"/a", "/b"})] == [str(number) for number in range(40)]
        assert [m.message.data for m in bag.messages({"/b"})] == [str(number) for number in range(1, 40, 2)]


@pytest.mark.parametrize("name", ["bag_0.mcap", "bag_0.db3", "metadata.yaml"])
def test_a_named_pipe_in_a_bag_is_refused_at_once(tmp_path: Path, name: str) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    os.mkfifo(bag / name)
    for function in (read_bag, bag_info, load_run):
        assert "Is a named pipe" in refused(function, bag) or name == "metadata.yaml"
    if name.endswith(".mcap"):
        assert "Is a named pipe" in refused(recover, bag, tmp_path / "saved")


def bomb(said: int) -> bytes:
    """A chunk of a small file that unpacks to far more."""
    packer = zstandard.ZstdCompressor().compressobj(size=said)
    data = b"".join(packer.compress(bytes(1 << 24)) for _ in range(2)) + packer.flush()
    return data


@pytest.mark.parametrize(("frame_says", "chunk_says"), [(-1, 1000), (2 << 24, 1000), (-1, 2**40), (2 << 24, 2**40)])
def test_chunks_that_unpack_to_more_than_they_may_are_refused(frame_says: int, chunk_says: int) -> None:
    packed = bomb(frame_says)
    assert len(packed) < 10_000
    said = refused(mcap_chunks.unpacked, packed, "zstd", chunk_says)
    assert "more than" in said or "damaged" in said


def test_a_message_that_unpacks_to_more_than_it_may_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_chunks, "MOST_BYTES", 1000)
    for frame_says in (-1, 2 << 24):
        refused(mcap_chunks.unpacked_message, bomb(frame_says))


def test_lz4_chunks_are_unpacked_up_to_what_they_say() -> None:
    import lz4.frame

    packed = lz4.frame.compress(bytes(10_000))
    assert mcap_chunks.unpacked(packed, "lz4", 10_000) == bytes(10_000)
    assert "another number of bytes" in refused(mcap_chunks.unpacked, packed, "lz4", 100)
    assert "damaged" in refused(mcap_chunks.unpacked, packed[:50] + b"xxxx", "lz4", 10_000)
    assert "can't be read" in refused(mcap_chunks.unpacked, packed, "snappy", 10_000)


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("UPDATE topics SET name = NULL WHERE id = 1", "a topic's name"),
        ("UPDATE messages SET timestamp = 'soon'", "can't be read"),
        ("UPDATE messages SET data = 3", "a message"),
        ("UPDATE topics SET offered_qos_profiles = '- history: 1'", "depth"),
    ],
)
def test_databases_with_values_of_other_types_are_refused(run: Path, tmp_path: Path, statement: str, said: str) -> None:
    database = as_sqlite(run, tmp_path / "other")
    with sqlite3.connect(database) as opened:
        rows = {name: opened.execute(f"SELECT * FROM {name}").fetchall() for name in ("topics", "messages")}
        for name in rows:  # the columns of rosbags' schema take no NULL
            opened.execute(f"CREATE TABLE copied AS SELECT * FROM {name}")
            opened.execute(f"DROP TABLE {name}")
            opened.execute(f"ALTER TABLE copied RENAME TO {name}")
        opened.execute(statement)
    opened.close()
    assert said in refused(raw, tmp_path / "other")


def test_qos_that_cannot_be_read_is_told_and_costs_no_message(tmp_path: Path) -> None:
    from mcap.writer import Writer as McapWriter

    path = tmp_path / "bag.mcap"
    writer = McapWriter(str(path))
    writer.start(profile="ros2")
    schema = writer.register_schema(STRING, "ros2msg", b"string data")
    profile = "- {history: keep_all, depth: 0, durability: volatil\xe9, deadline: {sec: 0, nsec: soon}}"
    channel = writer.register_channel("/words", "cdr", schema, {"offered_qos_profiles": profile})
    writer.add_message(channel, 1, bytes(STORE.serialize_cdr(text("hello"), STRING)), 1)
    writer.finish()
    info = bag_info(path)
    assert info.message_count == 1
    assert "QoS profiles that can't be read" in info.warnings[0]
    assert "unknown" in info_text(info)
    assert recover(path, tmp_path / "saved").messages == 1


def test_a_type_with_other_fields_than_in_jazzy_is_refused(tmp_path: Path) -> None:
    from mcap.writer import Writer as McapWriter

    path = tmp_path / "bag.mcap"
    writer = McapWriter(str(path))
    writer.start(profile="ros2")
    schema = writer.register_schema("geometry_msgs/msg/PoseWithCovarianceStamped", "ros2msg", b"float64 other")
    channel = writer.register_channel(MOVED, "cdr", schema, {})
    writer.add_message(channel, 1, bytes(12), 1)
    writer.finish()
    assert "with other fields than in ROS 2 Jazzy" in refused(load_run, path)


def test_a_bag_whose_displacements_are_missing_is_no_log(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        SyntheticRun(writer)
    with pytest.raises(AnalysisError, match="no displacements"):
        load_displacements(tmp_path / "run", "follower_1")


@pytest.mark.parametrize(
    "change",
    [
        lambda said: said.pop("relative_file_paths"),
        lambda said: said.update(relative_file_paths=["gone.mcap"]),
        lambda said: said.update(relative_file_paths=3),
        lambda said: said.update(topics_with_message_count=[1]),
        lambda said: said["topics_with_message_count"][0].update(message_count="many"),
        lambda said: said.update(relative_file_paths=["/etc/passwd"]),
    ],
)
def test_wrong_metadata_are_refused_in_one_line(run: Path, change: Callable[[dict[str, Any]], object]) -> None:
    edit_metadata(run, change)
    said = refused(read_bag, run)
    assert str(run) in said
    assert "reindex" in said


def test_descriptions_with_entities_and_broken_numbers_give_no_frames() -> None:
    entities = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 12))
    hostile = f'<!DOCTYPE r [<!ENTITY e0 "x">{entities}]><robot><joint name="&e11;"/></robot>'
    broken = '<robot><joint><parent link="a"/><child link="b"/><origin xyz="1 2" rpy="0 0 x"/></joint></robot>'
    for description in (hostile, broken, "<robot", "\x00"):
        transforms = Transforms()
        cdr = bytes(STORE.serialize_cdr(text(description), STRING))
        transforms.take("/leader/robot_description", STRING, cdr, 0)
        assert list(transforms.make()) == []


def test_the_verbs_end_with_one_line_and_code_2_on_a_cut_off_record(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = run.glob("*.mcap")
    data = file.read_bytes()
    broken = tmp_path / "broken"
    shutil.copytree(run, broken)
    for cut in (9, 40, len(data) // 2):
        Path(broken, file.name).write_bytes(data[:cut] + data[cut + 3 :])
        for verb in (["info"], ["analyze", "--no-pictures"], ["replay"], ["recover", "-o", str(tmp_path / f"o{cut}")]):
            code = main([verb[0], str(broken), *verb[1:], "--json"])
            captured = capsys.readouterr()
            if code == 0:
                json.loads(captured.out)
            else:
                assert code == 2
                assert len(captured.err.strip().splitlines()) == 1
