"""`formation compare`: the same totals as `formation analyze`, what differs, one-line errors."""

import json
import shutil
from pathlib import Path

import matplotlib.image
import pytest

from cli_tools import complaint
from report_samples import MEASURED, PREVIOUS
from robot_formation.cli.main import main
from robot_formation.reporting.comparison_table import comparison_text, comparisons
from robot_formation.reporting.differences import differing, value_text
from robot_formation.reporting.runs import load_runs
from synthetic_bag import STEPS, Step, write_run


def printed(capsys: pytest.CaptureFixture[str], *arguments: Path | str) -> str:
    assert main([str(argument) for argument in arguments]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    return said.out


def test_the_json_holds_each_run_as_analyze_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(printed(capsys, "compare", PREVIOUS, MEASURED, "--json"))
    assert list(found) == ["runs", "differing", "pictures"]
    assert found["pictures"] == []
    for run, bag in zip(found["runs"], (PREVIOUS, MEASURED), strict=True):
        assert run == json.loads(printed(capsys, "analyze", bag, "--json"))


def test_the_tables_values_are_the_totals(capsys: pytest.CaptureFixture[str]) -> None:
    first, second = (json.loads(printed(capsys, "analyze", bag, "--json"))["totals"] for bag in (PREVIOUS, MEASURED))
    rows = dict(comparisons(load_runs([PREVIOUS, MEASURED]))[1].rows)
    for name, key in (
        ("correction distance from timestep 4 (cm)", "correction_m"),
        ("  along u (cm)", "correction_u_m"),
        ("formation error, RMSE (cm)", "formation_error_rmse_m"),
    ):
        assert rows[name] == tuple(f"{100.0 * totals[key]:.2f}" for totals in (first, second))
    change = 100.0 * (second["correction_m"] / first["correction_m"] - 1.0)
    assert rows["  against run 1 (%)"] == ("-", f"{change:+.1f}")
    assert rows["movements"] == (str(first["movements"]), str(second["movements"]))


def test_only_what_differs_is_listed_as_differing(capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(printed(capsys, "compare", PREVIOUS, MEASURED, "--json"))
    assert found["differing"] == {"predictor.name": ["previous", "measured"]}
    details = [
        {"scenario": "a", "parameters": '{"world": {"x": 1, "y": [1]}}', "versions": '{"numpy": "1"}', "lost": "{}"},
        {"scenario": "a", "parameters": '{"world": {"x": 1.0, "y": [2]}}', "versions": '{"numpy": "2"}', "lost": "9"},
        {"scenario": "a", "parameters": "nonsense"},
    ]
    assert differing(details[:2]) == {"versions.numpy": ["1", "2"], "world.y": [[1], [2]]}
    assert differing(details)["world.x"] == [1, 1.0, None]


def test_values_are_written_for_people() -> None:
    written = {None: "-", True: "true", "": '""', 0.1 + 0.2: "0.3", "text": "text"}
    assert {value: value_text(value) for value in written} == written
    assert value_text([1, "a"]) == '[1, "a"]'
    assert len(value_text(list(range(1000)))) <= 60


def test_pictures_are_drawn_where_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "pictures"
    assert f"pictures: {out / 'corrections.png'}" in printed(capsys, "compare", PREVIOUS, MEASURED, "--out", out)
    assert sorted(path.name for path in out.iterdir()) == ["corrections.png", "errors.png", "trajectories.png"]
    for path in out.iterdir():
        assert matplotlib.image.imread(path)[..., :3].std() > 0.05


def test_by_default_pictures_go_beside_the_first_bag(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bags = [write_run(tmp_path / name, STEPS) for name in ("a", "b")]
    printed(capsys, "compare", *bags, "--no-pictures")
    assert not (tmp_path / "a_comparison").exists()
    printed(capsys, "compare", *bags)
    assert (tmp_path / "a_comparison" / "errors.png").exists()
    printed(capsys, "compare", *bags, "--format", "svg")
    assert (tmp_path / "a_comparison" / "errors.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_runs_of_different_length_followers_and_ends_are_set_side_by_side(tmp_path: Path) -> None:
    lost = write_run(tmp_path / "lost", STEPS[:4], lost=["follower_1"], details={"timesteps": "9"}, surface=False)
    runs = load_runs([lost, write_run(tmp_path / "two", STEPS, followers=2), write_run(tmp_path / "none", [])])
    overview, first, second = comparisons(runs)
    assert dict(overview.rows)["outcome"] == ("lost", "done", "incomplete")
    assert dict(first.rows)["timesteps finished"] == ("4 of 9", "5", "0")
    assert dict(second.rows)["timesteps finished"] == ("-", "5", "-")
    assert "follower 2" in comparison_text(runs)


def test_the_text_fits_into_a_terminal(tmp_path: Path) -> None:
    bags = [write_run(tmp_path / f"run_{number}", STEPS) for number in range(4)]
    text = comparison_text(load_runs(bags))
    tables = text.partition("\n\n")[2]
    assert max(map(len, tables.splitlines())) <= 100
    assert text.endswith("The runs say nothing of themselves that differs.")


def test_a_first_run_without_corrections_has_no_relative_change(tmp_path: Path) -> None:
    quiet = write_run(tmp_path / "quiet", [Step()] * 5)
    rows = dict(comparisons(load_runs([quiet, write_run(tmp_path / "other", STEPS)]))[1].rows)
    assert rows["correction distance from timestep 4 (cm)"][0] == "0.00"
    assert "  against run 1 (%)" not in rows


@pytest.mark.parametrize(
    ("bags", "said"),
    [
        (["one"], "nothing to be compared with; give two or more"),
        (["one", "one"], "given twice"),
        (["one", "one/one_0.mcap"], "given twice"),
        (["one", "missing"], "missing"),
        (["one", "text.txt"], "is not a bag"),
    ],
)
def test_what_cannot_be_compared_is_told_in_a_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, bags: list[str], said: str
) -> None:
    shutil.copytree(PREVIOUS, tmp_path / "one")
    (tmp_path / "one" / "track_two_previous_0.mcap").rename(tmp_path / "one" / "one_0.mcap")
    metadata = tmp_path / "one" / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("track_two_previous_0", "one_0"))
    (tmp_path / "text.txt").touch()
    assert said in complaint(capsys, "compare", *(tmp_path / bag for bag in bags))
