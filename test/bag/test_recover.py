"""A bag cut off anywhere gives back every chunk that was closed before the cut, and bad bags are told in one line."""

import shutil
from pathlib import Path

import pytest
from mcap.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader

from robot_formation.bag.errors import BagError
from robot_formation.bag.folder import bag_name
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recover import recover
from robot_formation.bag.writer import BagWriter
from synthetic_bag import STORE, text

STRING = "std_msgs/msg/String"
CHUNKS = 4
PER_CHUNK = 5


def write_chunks(path: Path, compression: str = "zstd") -> list[int]:
    """Write a bag; return its file's size after each closed chunk."""
    sizes = []
    with BagWriter(path, compression=compression) as writer:
        writer.add_topic("/words", STRING, TopicQos(history="keep_all", depth=0))
        writer.write_metadata("robot_formation", {"scenario": "track two", "seed": "3"})
        for number in range(CHUNKS * PER_CHUNK):
            # Equal stamps in pairs: recovery must keep the log times that told them apart.
            writer.write("/words", bytes(STORE.serialize_cdr(text(f"word {number}"), STRING)), number // 2)
            if number % PER_CHUNK == PER_CHUNK - 1:
                writer.end_chunk()
                (file,) = writer.partial_path.glob("*.mcap")
                sizes.append(file.stat().st_size)
    return sizes


def cut(bag: Path, size: int) -> Path:
    """Make the `.partial` folder that a writer killed at this file size would have left."""
    partial = bag.with_name("cut.partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    (partial / "cut_0.mcap").write_bytes((bag / f"{bag.name}_0.mcap").read_bytes()[:size])
    return partial


def messages(bag: Path) -> list[tuple[str, int, bytes]]:
    with AnyReader([bag]) as reader:
        return [(c.topic, stamp, bytes(data)) for c, stamp, data in reader.messages()]


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_every_closed_chunk_comes_back_wherever_the_file_is_cut(tmp_path: Path, compression: str) -> None:
    sizes = write_chunks(tmp_path / "run", compression)
    whole = messages(tmp_path / "run")
    total = (tmp_path / "run" / "run_0.mcap").stat().st_size
    for offset in sorted({*sizes, *(size + 1 for size in sizes), *range(sizes[0], total, 97), total - 1, total}):
        out = tmp_path / "saved"
        report = recover(cut(tmp_path / "run", offset), out)
        kept = PER_CHUNK * sum(size <= offset for size in sizes)
        # A chunk's index may be cut off behind the chunk itself, which then comes back too.
        assert report.messages in (kept, kept + PER_CHUNK)
        assert messages(out) == whole[: report.messages]
        with read_bag(out) as bag:
            assert bag.metadata("robot_formation") == {"scenario": "track two", "seed": "3"}
        shutil.rmtree(out)


def test_the_report_tells_what_was_saved_and_what_not(tmp_path: Path) -> None:
    sizes = write_chunks(tmp_path / "run")
    partial = cut(tmp_path / "run", sizes[1] + 20)
    report = recover(partial, tmp_path / "saved")
    assert report.path == tmp_path / "saved"
    assert report.message_counts == {"/words": 2 * PER_CHUNK}
    assert report.last_stamp_ns == messages(tmp_path / "run")[2 * PER_CHUNK - 1][1]
    assert (report.complete, report.damaged_chunks, report.lost_bytes) == (False, 0, 20)
    assert partial.exists()
    whole = recover(tmp_path / "run", tmp_path / "copy")
    assert (whole.messages, whole.complete, whole.lost_bytes) == (CHUNKS * PER_CHUNK, True, 0)


def test_a_damaged_chunk_is_left_out_and_counted(tmp_path: Path) -> None:
    sizes = write_chunks(tmp_path / "run")
    file = tmp_path / "run" / "run_0.mcap"
    data = bytearray(file.read_bytes())
    data[sizes[1] + 70] ^= 0xFF
    file.write_bytes(data)
    report = recover(tmp_path / "run", tmp_path / "saved")
    assert report.damaged_chunks == 1
    assert report.messages == (CHUNKS - 1) * PER_CHUNK


def test_recovered_bags_keep_qos_types_and_hashes(tmp_path: Path) -> None:
    sizes = write_chunks(tmp_path / "run")
    recover(cut(tmp_path / "run", sizes[0]), tmp_path / "saved")
    connections = []
    for bag in (tmp_path / "run", tmp_path / "saved"):
        with AnyReader([bag]) as reader:
            (connection,) = reader.connections
            connections.append((connection.topic, connection.msgdef, connection.digest, connection.ext))
    assert connections[0] == connections[1]


def test_recovery_keeps_the_log_times_of_another_recorder(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        for log_time in (7, 9, 9):
            writer.write("/words", bytes(STORE.serialize_cdr(text("hello"), STRING)), 5, log_time_ns=log_time)
    recover(tmp_path / "run", tmp_path / "saved")
    assert [stamp for _, stamp, _ in messages(tmp_path / "saved")] == [7, 9, 9]


def test_an_unclosed_bag_is_read_like_a_finished_one_and_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    sizes = write_chunks(tmp_path / "run")
    partial = cut(tmp_path / "run", sizes[2])
    for path in (partial, partial / "cut_0.mcap"):
        with read_bag(path) as bag:
            assert bag.recovered
            assert [m.message.data for m in bag.messages({"/words"})] == [f"word {n}" for n in range(3 * PER_CHUNK)]
        assert list(scratch.iterdir()) == []


def test_a_finished_bag_is_read_as_folder_and_as_file(tmp_path: Path) -> None:
    write_chunks(tmp_path / "run")
    for path in (tmp_path / "run", tmp_path / "run" / "run_0.mcap"):
        with read_bag(path) as bag:
            assert not bag.recovered
            assert bag.topics == {"/words": STRING}
            assert bag.message_count == CHUNKS * PER_CHUNK
            assert len(list(bag.messages({"/words", "/missing"}))) == CHUNKS * PER_CHUNK
            assert list(bag.messages({"/missing"})) == []
            bag.require({"/words": STRING})
            with pytest.raises(BagError, match="no messages on '/missing'"):
                bag.require({"/missing": STRING})
            with pytest.raises(BagError, match=r"'/words' is std_msgs/msg/String"):
                bag.require({"/words": "std_msgs/msg/UInt32"})


def make_bad(tmp_path: Path, kind: str) -> Path:
    path = tmp_path / "bad"
    if kind == "missing":
        return path
    if kind == "file":
        path.write_text("hello")
    elif kind == "empty file":
        path = tmp_path / "bad.mcap"
        path.touch()
    elif kind == "other mcap":
        path = tmp_path / "bad.mcap"
        writer = McapWriter(str(path))
        writer.start(profile="x-other")
        writer.finish()
    elif kind == "no mcap":
        path = tmp_path / "bad.mcap"
        path.write_bytes(b"no MCAP file at all, whatever its name says")
    elif kind == "folder":
        path.mkdir()
    elif kind == "no messages":
        BagWriter(path).close()
    elif kind == "nothing saved":
        write_chunks(tmp_path / "run")
        return cut(tmp_path / "run", 60)
    elif kind == "metadata":
        write_chunks(path)
        (path / "metadata.yaml").write_text("version: [9")
    return path


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("missing", "doesn't exist"),
        ("file", "is not a bag"),
        ("folder", "is not a bag"),
        ("empty file", "seems to be empty"),
        ("no mcap", "is no MCAP file"),
        ("other mcap", "profile is .x-other., not that of ROS 2"),
        ("no messages", "is empty"),
        ("nothing saved", "no message that can be read"),
        ("metadata", "no valid YAML in line 2"),
    ],
)
def test_bad_bags_are_told_in_one_line(tmp_path: Path, kind: str, says: str) -> None:
    with pytest.raises(BagError, match=says) as caught:
        read_bag(make_bad(tmp_path, kind))
    assert "\n" not in str(caught.value)


def test_a_finished_bag_whose_file_was_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    write_chunks(tmp_path / "run")
    file = tmp_path / "run" / "run_0.mcap"
    file.write_bytes(file.read_bytes()[:-300])
    with read_bag(tmp_path / "run") as bag:
        assert bag.recovered
        assert bag.message_count > 0


def test_a_chunk_damaged_inside_a_finished_bag_is_told_while_reading(tmp_path: Path) -> None:
    sizes = write_chunks(tmp_path / "run")
    file = tmp_path / "run" / "run_0.mcap"
    data = bytearray(file.read_bytes())
    data[sizes[1] + 70] ^= 0xFF
    file.write_bytes(data)
    with read_bag(tmp_path / "run") as bag, pytest.raises(BagError, match="can't be read"):
        list(bag.messages({"/words"}))


@pytest.mark.parametrize("kind", ["missing", "folder", "no mcap", "other mcap", "nothing saved"])
def test_recover_refuses_what_is_no_bag_and_makes_nothing(tmp_path: Path, kind: str) -> None:
    source = make_bad(tmp_path, kind)
    with pytest.raises(BagError):
        recover(source, tmp_path / "saved")
    assert not (tmp_path / "saved").exists()
    assert not (tmp_path / "saved.partial").exists()


def test_recover_overwrites_nothing(tmp_path: Path) -> None:
    write_chunks(tmp_path / "run")
    (tmp_path / "saved").mkdir()
    with pytest.raises(BagError, match="not overwritten"):
        recover(tmp_path / "run", tmp_path / "saved")


def test_a_bags_name_has_no_suffix(tmp_path: Path) -> None:
    assert {bag_name(tmp_path / name) for name in ("run", "run.partial", "run.mcap", "run.db3")} == {"run"}
