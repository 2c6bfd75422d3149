"""A growing table gives back what went in, whatever cut it off, and refuses what is none of its own."""

from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.batch.resumable_table import ResumableTable, read_record, write_record
from robot_formation.errors import FormationError


@dataclass(frozen=True)
class Row:
    name: str
    number: int
    value: float
    choice: float | None = None
    count: int | None = None


def table_in(folder: Path) -> ResumableTable[Row]:
    return ResumableTable(folder / "rows.csv", Row, FormationError, "no table of these; choose another")


floats = st.floats(allow_nan=False, allow_infinity=False)
rows = st.builds(
    Row,
    name=st.text(st.characters(codec="ascii", categories=("L", "N", "P")), max_size=9),
    number=st.integers(),
    value=floats,
    choice=st.none() | floats,
    count=st.none() | st.integers(),
)


@given(st.lists(rows, max_size=4), st.lists(rows, max_size=4))
def test_rows_come_back_to_the_last_bit_in_their_order(
    tmp_path_factory: pytest.TempPathFactory, first: list[Row], later: list[Row]
) -> None:
    table = table_in(tmp_path_factory.mktemp("table"))
    table.rewrite(first)
    table.append(later)
    assert repr(list(table.read())) == repr([*first, *later])


def test_a_half_written_row_is_left_out_and_gone_when_the_table_is_written_anew(tmp_path: Path) -> None:
    table = table_in(tmp_path)
    table.rewrite([Row("a", 1, 0.5), Row("b", 2, 12.25)])
    whole = table.path.read_bytes()
    table.path.write_bytes(whole[:-4])
    (kept,) = table.read()
    assert kept == Row("a", 1, 0.5)
    table.rewrite([kept])
    assert whole.startswith(table.path.read_bytes())
    assert [path.name for path in tmp_path.iterdir()] == ["rows.csv"]


@pytest.mark.parametrize("line", ["a,1,0.5,", "a,one,0.5,,", "a,1,,,", "a,1,inf,,", "a,1,0.5,,,"])
def test_a_damaged_line_is_named(tmp_path: Path, line: str) -> None:
    table = table_in(tmp_path)
    table.rewrite([Row("a", 1, 0.5)])
    table.path.write_text(table.path.read_text() + line + "\n")
    with pytest.raises(FormationError, match=r"rows\.csv: line 3 can't be read; delete it to run it again"):
        list(table.read())


@pytest.mark.parametrize("content", ["", "name,number\n", "name,number,value,choice,count"])
def test_another_file_is_refused(tmp_path: Path, content: str) -> None:
    table = table_in(tmp_path)
    table.path.write_text(content)
    with pytest.raises(FormationError, match=r"rows\.csv: no table of these; choose another"):
        list(table.read())


def test_a_record_comes_back_and_damage_is_a_value_error(tmp_path: Path) -> None:
    path = tmp_path / "record.json"
    write_record(path, {"seed": 1, "names": ["a"]})
    assert read_record(path) == {"seed": 1, "names": ["a"]}
    for content in ("", "[]", "{", "[" * 100_000):
        path.write_text(content)
        with pytest.raises(ValueError):
            read_record(path)
    with pytest.raises(ValueError, match="No such file"):
        read_record(tmp_path / "gone.json")
