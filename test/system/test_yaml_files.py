"""YAML that somebody else wrote: each failure is one line with the place, and nothing takes long or much memory."""

import contextlib
import os
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.errors import MOST_CHARACTERS, FormationError, shown
from robot_formation.experiment.scenario import load, load_track, override
from robot_formation.system.files import open_file, read_file, whole_lines
from robot_formation.system.yaml_files import YamlError, parse_yaml, read_yaml, yaml_text

BOMB = "a: &b0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"b{n}: &b{n} [{', '.join([f'*b{n - 1}'] * 10)}]\n" for n in range(1, 10)
)


class RefusedError(FormationError):
    """What a caller of `read_yaml` raises."""


@pytest.mark.parametrize(
    ("text", "problem", "line"),
    [
        ("seed: 1\nname: x\nseed: 2\n", "'seed' is given twice (first in line 1)", 3),
        ("world:\n  a: 1\n  a: 2\n", "'a' is given twice", 3),
        ("a: [{b: 1, b: 1}]", "'b' is given twice", 1),
        ("seed: 2001-99-99", "'2001-99-99' can't be read as timestamp", 1),
        ("a: 1\nseed: !!bool x", "can't be read as bool", 2),
        ("0x_", "can't be read as int", 1),
        ("!!timestamp q", "can't be read as timestamp", 1),
        ("!!float x", "can't be read as float", 1),
        ("1" * 5000, "can't be read as int", 1),
        ("0x" + "f" * 5000, "larger than any number", 1),
        ("!!python/name:os.system", "could not determine a constructor", 1),
        ("a: 1\nworld: &w {a: *w}", "inside what it refers to", 2),
        ("*missing", "before it", 1),
        (BOMB, "more than 100000 values", 5),
        ("[" * 100, "nested more than", 1),
        ("[" * 5000, "nest", 1),  # libyaml has a bound of its own from PyYAML 6.0.4 on, in its own words
        ("? [a]\n: b", "unhashable", 1),
        ("a: b: c", "not allowed", 1),
        (b"a: \xff", "no text in UTF-8", None),
        ("a: \x00", "control characters", None),
        ("a" * (2 << 20), "more than 1048576 characters", None),
    ],
)
def test_what_is_wrong_is_told_with_its_line(text: str, problem: str, line: int) -> None:
    with pytest.raises(YamlError) as raised:
        parse_yaml(text)
    assert problem in raised.value.problem
    assert raised.value.line == line
    assert len(str(raised.value)) <= MOST_CHARACTERS


@pytest.mark.parametrize(
    "text",
    ["", "1", "a: [1, 2.5, x]", "a: &x [1]\nb: *x", "b: &b {a: 1}\nd: &d {<<: *b, a: 2}\ne: {<<: *d}", '{"a": [1]}'],
)
def test_plain_yaml_is_read_as_it_always_was(text: str) -> None:
    assert parse_yaml(text) == parse_yaml(text.encode()) == yaml.safe_load(text)


_SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=120)


@given(st.recursive(_SCALARS, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=10))
def test_values_are_written_so_that_they_are_read_as_they_were(value: object) -> None:
    assert yaml.safe_load(yaml_text(value)) == value


def test_keys_are_written_in_their_order_or_sorted() -> None:
    assert yaml_text({"b": [1, 2.5], "a": {}}) == "b:\n- 1\n- 2.5\na: {}\n"
    assert yaml_text({"b": 1, "a": True}, sort_keys=True) == "a: true\nb: 1\n"


@given(st.text(alphabet="ab01.:-_*&!<>{}[],'\"\n |%@?#~", max_size=40))
def test_no_text_ends_in_another_error(text: str) -> None:
    with contextlib.suppress(YamlError):
        parse_yaml(text)


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "missing", "large"])
def test_only_files_are_read(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "file"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "large":
        path.write_bytes(b" " * (2 << 20))
    elif kind == "device":
        path = Path("/dev/zero")
    said = {
        "pipe": "Is a named pipe",
        "device": "Is a device",
        "folder": "Is a directory",
        "missing": "No such file",
        "large": "larger than 1.0 MiB",
    }
    with pytest.raises(RefusedError, match=f"{said[kind]}.*; make one"):
        read_yaml(path, refuse=RefusedError, remedy="make one")


def test_a_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"12345678")
    assert read_file(tmp_path / "file", 8) == b"12345678"
    with pytest.raises(OSError, match="larger than 7 B"):
        read_file(tmp_path / "file", 7)
    with pytest.raises(OSError, match="No such file"):
        open_file("a\0b")


@pytest.mark.parametrize(
    "setting",
    [
        "seed=2001-99-99",
        "seed=!!bool x",
        "seed=0x_",
        "seed=" + "1" * 5000,
        "world.overhead.enabled={a: 1, a: 2}",
        f"leader.timesteps=[{'x' * 40_000}]",
        "leader.timesteps=" + "[" * 20 + "'" + "y" * 5000 + "'" + "]" * 20,
        f"{'z' * 40_000}=1",
        f"predictor.{'z' * 40_000}=1",
    ],
)
def test_settings_of_any_kind_are_refused_in_a_short_line(setting: str) -> None:
    with pytest.raises(FormationError) as raised:
        override(load_track("one"), [setting])
    assert len(str(raised.value)) <= MOST_CHARACTERS
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seed: 1\nseed: 2\n", "line 2: 'seed' is given twice"),
        ("seed: 2001-99-99\n", "line 1: '2001-99-99'"),
        ("world: &w {a: *w}\n", "line 1: '*w' stands inside"),
        (BOMB.replace("b9", "seed"), "more than 100000 values"),
        ("world: {motor: {gain: 1}, motor.gain: 2}\n", "world: 'motor.gain' is given twice"),
        ('predictor: {"for\\e[31m\\ngetting": 1}\n', "no parameter 'for\\x1b[31m getting'"),
    ],
)
def test_a_scenario_is_refused_with_its_name_and_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(FormationError) as raised:
        load(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert said in str(raised.value)


def test_values_are_shown_short_whatever_they_are() -> None:
    inner: list[Any] = [1]
    for _ in range(50):
        inner = [inner] * 9
    recursive: dict[str, Any] = {}
    recursive["a"] = recursive
    values = [inner, recursive, "x" * 10_000, b"x" * 10_000, 10**10_000, dict.fromkeys(range(1000), "y" * 50), None]
    assert all(len(shown(value)) <= 80 for value in values)
    assert shown("short") == "'short'"
    assert shown(2.5) == "2.5"
    assert shown(["a", 1]) == "['a', 1]"


def test_a_long_message_keeps_its_beginning_and_its_remedy() -> None:
    text = str(FormationError("file.yaml: " + "x" * 5000 + "; correct the file"))
    assert len(text) == MOST_CHARACTERS
    assert text.startswith("file.yaml: ")
    assert text.endswith("; correct the file")


def test_a_line_of_a_table_without_its_end_was_cut_off(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_bytes(b"a,b\r\n1,2\n3")
    assert list(whole_lines(tmp_path / "t.csv")) == ["a,b\r\n", "1,2\n"]


def test_a_table_of_one_endless_line_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with (tmp_path / "t.csv").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(ValueError, match="more than 20000 characters"):
        list(whole_lines(tmp_path / "t.csv"))
