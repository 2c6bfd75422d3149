"""`formation info`, `recover`, `record` and `play` on the command line, as far as no ROS graph is needed."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from robot_formation.bag.qos import TopicQos
from robot_formation.bag.writer import BagWriter
from robot_formation.cli.main import main
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.nodes.player.player_node import PlayerParameters
from robot_formation.nodes.recorder.recorder_node import RecorderParameters
from robot_formation.parameters import to_mapping
from synthetic_bag import STORE, Step, SyntheticRun, text

STRING = "std_msgs/msg/String"
SECOND = 10**9


def cdr(words: str) -> bytes:
    return bytes(STORE.serialize_cdr(text(words), STRING))


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/words", STRING, TopicQos(durability="transient_local", depth=1))
        writer.write_metadata("robot_formation", {"scenario": "two", "parameters": '{"leader": {"timesteps": 4}}'})
        for number in range(10):
            writer.write("/words", cdr(f"word {number}"), number * SECOND)
    return tmp_path / "bag"


def cut_off(bag: Path) -> Path:
    partial = bag.with_name("cut.partial")
    partial.mkdir()
    (partial / "cut_0.mcap").write_bytes((bag / f"{bag.name}_0.mcap").read_bytes()[:-20])
    return partial


def foreign(path: Path, plugin: StoragePlugin) -> Path:
    """A bag as rosbag2 of another time writes it."""
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        words = writer.add_connection("/words", STRING, typestore=STORE)
        other = writer.add_connection("/other", STRING, typestore=STORE)
        for number in range(5):
            writer.write(words, number * SECOND, cdr(f"word {number}"))
        writer.write(other, 2 * SECOND, cdr("other"))
    return path


def told(capsys: pytest.CaptureFixture[str], *arguments: object, code: int = 0) -> str:
    """Run a verb; returns standard output, or with a code of failure the one line on standard error."""
    assert main([str(argument) for argument in arguments]) == code
    found = capsys.readouterr()
    if code == 0:
        return found.out
    assert found.out == ""
    (line,) = found.err.strip().splitlines()
    return line


def test_info_tells_the_figures_of_ros2_bag_info(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = told(capsys, "info", bag)
    for words in ("bag_0.mcap", "mcap, compression zstd", "jazzy", "9.000000000s", "scenario:          two"):
        assert words in said
    assert "1970-01-01 00:00:09 UTC (9.000000000), simulated time" in said
    assert f"/words | Type: {STRING} | Count:      10 | QoS: reliable transient local" in said


def test_info_as_json(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(told(capsys, "info", bag, "--json"))
    assert (found["messages"], found["start_ns"], found["end_ns"], found["duration_s"]) == (10, 0, 9 * SECOND, 9.0)
    assert found["simulated_time"] is True
    assert (found["closed"], found["storage"], found["ros_distro"]) == (True, "mcap", "jazzy")
    assert found["metadata"] == {"scenario": "two", "parameters": {"leader": {"timesteps": 4}}}
    (topic,) = found["topics"]
    assert (topic["name"], topic["type"], topic["messages"]) == ("/words", STRING, 10)
    assert topic["type_hash"] == STORE.hash_rihs01(STRING)
    assert topic["offered_qos_profiles"][0]["durability"] == "transient_local"


@pytest.mark.parametrize("dates_s", [(1_700_000_000,), ()])
def test_dates_of_a_clock_and_an_empty_bag_are_not_called_simulated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], dates_s: tuple[int, ...]
) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        for date_s in dates_s:
            writer.write("/words", cdr("word"), date_s * SECOND)
    assert json.loads(told(capsys, "info", tmp_path / "bag", "--json"))["simulated_time"] is False
    assert "simulated" not in told(capsys, "info", tmp_path / "bag")


def test_early_times_of_no_run_are_simulated_or_of_a_clock_that_was_not_set(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = foreign(tmp_path / "foreign", StoragePlugin.MCAP)
    assert json.loads(told(capsys, "info", bag, "--json"))["simulated_time"] is None
    assert told(capsys, "info", bag).count("simulated time or a clock that was not set") == 2


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_bags_of_another_make_are_summarised(tmp_path: Path, capsys: pytest.CaptureFixture[str], plugin: Any) -> None:
    bag = foreign(tmp_path / "foreign", plugin)
    found = json.loads(told(capsys, "info", bag, "--json"))
    assert found["storage"] == {StoragePlugin.MCAP: "mcap", StoragePlugin.SQLITE3: "sqlite3"}[plugin]
    assert {topic["name"]: topic["messages"] for topic in found["topics"]} == {"/words": 5, "/other": 1}
    assert found["duration_s"] == 4.0
    # Without metadata.yaml, as a killed recorder leaves it, and as a file alone.
    (bag / "metadata.yaml").unlink()
    (file,) = bag.iterdir()
    for path in (bag, file):
        assert json.loads(told(capsys, "info", path, "--json"))["messages"] == 6


def test_analyze_reads_a_run_in_a_bag_of_another_make(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from robot_formation.bag.reader import read_bag

    with BagWriter(tmp_path / "ours") as writer:
        run = SyntheticRun(writer)
        run.step(Step())
    with (
        read_bag(tmp_path / "ours") as ours,
        Writer(tmp_path / "theirs", version=8, storage_plugin=StoragePlugin.SQLITE3) as theirs,
    ):
        connections = {}
        for message in ours.raw_messages(ours.topics):
            if message.topic not in connections:
                connections[message.topic] = theirs.add_connection(message.topic, message.type_name, typestore=STORE)
            theirs.write(connections[message.topic], message.stamp_ns, message.cdr)
    results = [json.loads(told(capsys, "analyze", tmp_path / name, "--json")) for name in ("ours", "theirs")]
    assert [Path(result.pop("bag")).name for result in results] == ["ours", "theirs"]
    assert results[0] == results[1]


def test_an_empty_bag_has_a_summary_but_cannot_be_played(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    BagWriter(tmp_path / "bag").close()
    assert json.loads(told(capsys, "info", tmp_path / "bag", "--json"))["messages"] == 0
    assert "is empty" in told(capsys, "play", tmp_path / "bag", code=2)


def test_a_bag_that_was_cut_off_is_summarised_and_completed_under_its_name(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    partial = cut_off(bag)
    assert "formation recover" in told(capsys, "info", partial)
    assert json.loads(told(capsys, "info", partial, "--json"))["closed"] is False
    said = told(capsys, "recover", partial)
    assert f"saved 10 messages on 1 topics, 9.000 s: {bag.with_name('cut')}" in said
    assert partial.exists()
    assert json.loads(told(capsys, "info", bag.with_name("cut"), "--json"))["closed"] is True
    assert "not overwritten" in told(capsys, "recover", partial, code=2)


def test_recover_says_what_is_missing(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = bag / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:-1000])
    found = json.loads(told(capsys, "recover", bag, "-o", bag.with_name("saved"), "--json"))
    assert (found["messages"], found["complete"], found["damaged_chunks"]) == (10, False, 0)
    assert found["lost_bytes"] >= 0
    assert found["path"] == str(bag.with_name("saved"))
    shutil.rmtree(bag.with_name("saved"))
    assert "can't be read" in told(capsys, "recover", bag)
    assert bag.with_name("bag_recovered").is_dir()


def test_a_bag_that_is_being_written_is_not_recovered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic("/words", STRING, TopicQos())
    writer.write("/words", cdr("hello"), 0)
    writer.end_chunk()
    assert "still being written" in told(capsys, "recover", tmp_path / "bag.partial", code=2)
    assert json.loads(told(capsys, "info", tmp_path / "bag.partial", "--json"))["messages"] == 1
    writer.close()


@pytest.mark.parametrize("verb", ["info", "recover", "play"])
def test_a_missing_bag_and_what_is_no_bag_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    assert "doesn't exist" in told(capsys, verb, tmp_path / "nowhere", code=2)
    assert "is not a bag" in told(capsys, verb, tmp_path, code=2)
    (tmp_path / "file.txt").write_text("hello")
    assert "is not a bag" in told(capsys, verb, tmp_path / "file.txt", code=2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--rate", "0"], "--rate is 0, but must be above 0"),
        (["--rate", "-1"], "above 0"),
        (["--topics", "/wrds"], "no topic '/wrds'; did you mean '/words'?"),
        (["--regex", "*"], "no regular expression"),
        (["--exclude", "("], "no regular expression"),
        (["--rate", "1e9"], "outside"),
        (["--start", "-1"], "outside"),
        (["--remap", "/words=/other"], "/from:=/to"),
    ],
)
def test_what_cannot_be_played_is_one_line(
    bag: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    assert words in told(capsys, "play", bag, *arguments, code=2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "say what to record"),
        (["--all", "/words"], "--all alone"),
        (["--regex", "*"], "no regular expression"),
        (["--all", "--exclude", "("], "no regular expression"),
        (["--all", "-o", "{bag}"], "exists already and is not overwritten"),
    ],
)
def test_what_cannot_be_recorded_is_one_line(
    bag: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert words in told(capsys, "record", *(argument.format(bag=bag) for argument in arguments), code=2)


@pytest.mark.parametrize("arguments", [["--max-size", "0"], ["--max-duration", "long"], ["--compression", "gzip"]])
def test_options_out_of_range_are_usage_errors(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["record", "--all", *arguments])
    assert caught.value.code == 2


@pytest.mark.parametrize(("name", "parameters"), [("recorder", RecorderParameters), ("player", PlayerParameters)])
def test_config_files_hold_only_known_parameters_that_differ_from_the_defaults(
    name: str, parameters: type[PlayerParameters] | type[RecorderParameters]
) -> None:
    defaults = to_mapping(parameters())
    assert [key for key, value in node_defaults(name).items() if defaults[key] == value] == []
