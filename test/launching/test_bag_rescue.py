"""What becomes of a run's bag when its recorder could not finish it."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from robot_formation.bag.bag_path import recover_hint
from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recover import recover
from robot_formation.bag.run_details import value
from robot_formation.bag.writer import BagWriter
from robot_formation.launching import bag_rescue
from robot_formation.launching.bag_rescue import missing_messages, rescue
from synthetic_bag import STORE, text

STRING = "std_msgs/msg/String"


def write(path: Path, **metadata: Any) -> Path:
    with BagWriter(path) as writer:
        writer.add_topic("/words", STRING, TopicQos())
        writer.write("/words", bytes(STORE.serialize_cdr(text("hello"), STRING)), 5)
        if metadata:
            writer.write_metadata(METADATA_NAME, {key: json.dumps(value) for key, value in metadata.items()})
    return path


@pytest.fixture
def cut_off(tmp_path: Path) -> Path:
    """A bag that was never renamed to its name, which is returned."""
    write(tmp_path / "bag").rename(tmp_path / "bag.partial")
    return tmp_path / "bag"


def test_a_bag_that_was_cut_off_is_completed_under_its_name(cut_off: Path) -> None:
    assert rescue(cut_off) == (cut_off, "")
    assert os.listdir(cut_off.parent) == ["bag"]
    with read_bag(cut_off) as bag:
        assert bag.message_count == 1


def test_where_that_fails_it_stays_where_the_recorder_said_and_the_command_works(
    cut_off: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(source: Path, out: Path) -> None:
        raise BagError(f"{source}: no space left{recover_hint(source)}")

    monkeypatch.setattr(bag_rescue, "recover", refuse)
    bag, problem = rescue(cut_off)
    assert bag is None
    partial = cut_off.with_name("bag.partial")
    assert f"'formation recover {partial}'" in problem
    assert os.listdir(cut_off.parent) == ["bag.partial"]
    assert recover(partial, cut_off).messages == 1


def test_a_system_error_leaves_it_there_too(cut_off: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(source: Path, out: Path) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(bag_rescue, "recover", refuse)
    partial = cut_off.with_name("bag.partial")
    assert rescue(cut_off) == (None, f"{partial} can't be completed: Input/output error")
    assert os.listdir(cut_off.parent) == ["bag.partial"]


def test_a_completed_bag_is_there_although_what_it_was_made_of_cannot_be_removed(
    cut_off: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(folder: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(shutil, "rmtree", refuse)
    bag, problem = rescue(cut_off)
    assert bag == cut_off
    assert problem.startswith(f"{cut_off}.cut_off can't be removed: Permission denied")
    with read_bag(cut_off) as opened:
        assert opened.message_count == 1


def test_no_bag_at_all_is_none(tmp_path: Path) -> None:
    assert rescue(tmp_path / "bag") == (None, "")


def test_messages_that_were_lost_are_said_in_one_line(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", lost={"/clock": 1, "/path": 3}, dropped={"/path": 2})
    assert missing_messages(bag) == "the bag lacks 6 messages that were lost on the way: /path (5), /clock (1)"
    many = write(tmp_path / "many", lost={f"/topic_{number}": 1 for number in range(7)})
    assert missing_messages(many).endswith(" and 2 more topics")


@pytest.mark.parametrize("text", ["1e999", '{"a": NaN}', "[-Infinity]", "[" * 100_000, "9" * 5000])
def test_what_is_no_strict_json_stays_a_text(text: str) -> None:
    assert value(text) == text


@pytest.mark.parametrize("lost", [5, ["/clock"], {"/clock": "many", "/path": None, "/tf": -1}])
def test_counts_that_are_none_are_left_out(tmp_path: Path, lost: dict[str, Any] | int | list[str]) -> None:
    assert missing_messages(write(tmp_path / "bag", lost=lost)) == ""


def test_a_whole_bag_lacks_nothing(tmp_path: Path) -> None:
    assert missing_messages(write(tmp_path / "bag")) == ""
