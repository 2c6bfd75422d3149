"""The table, the pictures and the verb `analyze`."""

import argparse
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import pytest

from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.report import text_report, write_pictures
from robot_formation.cli import analyze
from robot_formation.errors import FormationError
from synthetic_bag import STEPS, write_run

PICTURES = ["corrections.png", "eigenvalues.png", "formation_error.png", "trajectory.png"]
DETAILS = {"scenario": "track two", "predictor": "measured", "surface": "bowl", "seed": "3", "timesteps": "5"}


def run_verb(*arguments: object) -> int:
    parser = argparse.ArgumentParser()
    analyze.add_parser(parser.add_subparsers())
    args = parser.parse_args(["analyze", *map(str, arguments)])
    return analyze.run(args)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", STEPS, details=DETAILS)


def test_the_table_has_a_row_per_timestep_in_centimetres_and_degrees(bag: Path) -> None:
    record = load_run(bag)
    lines = text_report(record, analyse(record)).splitlines()
    assert lines[0] == "track two: predictor measured, surface bowl, seed 3"
    row = next(line for line in lines if line.split()[:1] == ["4"])
    assert row.split() == ["4", "3.10", "5.30", "4.00", "4.70", "1.10", "3.20", "0.40", "-0.50", "4", "5.00", "-17.19"]
    assert any(line.startswith("correction distance from timestep 4  6.30 cm (u 1.10, v 5.20)") for line in lines)
    assert "timesteps finished                   5 of 5" in lines
    assert lines[-1] == "outcome: done"
    assert max(map(len, lines)) <= 100


def test_missing_values_are_dashes(bag: Path) -> None:
    record = replace(load_run(bag), tracks={}, details={})
    lines = text_report(record, analyse(record)).splitlines()
    assert lines[0] == "formation run"
    assert next(line for line in lines if line.split()[:1] == ["1"]).split()[-2:] == ["-", "-"]
    assert "path                                 -" in lines


def test_a_lost_run_is_told_with_its_unfinished_timestep(tmp_path: Path) -> None:
    steps = [*STEPS[:4], replace(STEPS[0], finished=False)]
    record = load_run(write_run(tmp_path / "run", steps, details=DETAILS, lost=["follower_1"]))
    report = text_report(record, analyse(record))
    assert "unfinished timestep                  5: 1 correction moves (u 2.00, v 0.00 cm)" in report
    assert report.endswith("outcome: lost")


def test_several_followers_have_a_section_each(tmp_path: Path) -> None:
    record = load_run(write_run(tmp_path / "run", STEPS, followers=2))
    report = text_report(record, analyse(record))
    assert report.index("\nfollower 1\n") < report.index("\nfollower 2\n")
    assert report.count("timesteps finished") == 2
    lines = report.splitlines()
    chain = lines[lines.index("along the chain") + 1 :]
    assert chain[0].split() == ["follower", "1", "2"]
    first, second = (found.totals["formation_error_rmse_m"] for found in analyse(record).followers)
    assert chain[1].split()[-1] == f"{second / first:.2f}"
    assert max(map(len, lines)) <= 100


def test_the_verb_prints_the_table_and_draws_pictures_beside_the_bag(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_verb(bag) == 0
    said = capsys.readouterr()
    assert said.err == ""
    folder = bag.with_name("run_analysis")
    assert f"pictures: {folder / 'trajectory.png'}, {folder / 'corrections.png'}" in said.out
    for name in PICTURES:
        picture = matplotlib.image.imread(folder / name)
        assert picture.shape[0] > 400
        assert picture.shape[1] > 800
        assert picture[..., :3].std() > 0.05
    assert sorted(p.name for p in bag.iterdir()) == ["metadata.yaml", "run_0.mcap"]
    assert run_verb(bag) == 0


def test_json_is_alone_on_standard_output_and_draws_only_when_told_where(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_verb(bag, "--json") == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert list(found)[:4] == ["scenario", "outcome", "timesteps", "totals"]
    assert (found["seed"], found["predictor"], found["surface"], found["bag"]) == (3, "measured", "bowl", str(bag))
    assert found["pictures"] == []
    assert set(found["conditions"].values()) == {None}  # this bag doesn't say its parameters
    assert said.err == ""
    assert not bag.with_name("run_analysis").exists()
    assert run_verb(bag, "--json", "--out", tmp_path / "pictures") == 0
    assert json.loads(capsys.readouterr().out)["outcome"] == "done"
    assert sorted(p.name for p in (tmp_path / "pictures").iterdir()) == PICTURES


def test_a_lost_run_is_a_successful_analysis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write_run(tmp_path / "run", STEPS, details=DETAILS, lost=["follower_1"])
    assert run_verb(bag, "--no-pictures") == 0
    assert capsys.readouterr().out.rstrip().endswith("outcome: lost")
    assert not bag.with_name("run_analysis").exists()


def test_bad_input_raises_one_line(bag: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for arguments in (
        [tmp_path / "nothing"],
        [bag, "--out", tmp_path / "file"],
        [bag, "--out", tmp_path / "file" / "x"],
    ):
        with pytest.raises(FormationError) as caught:
            run_verb(*arguments)
        assert "\n" not in str(caught.value)


def test_pictures_are_drawn_for_every_kind_of_run(tmp_path: Path) -> None:
    steps = [*STEPS, replace(STEPS[0], finished=False)]
    lost = load_run(write_run(tmp_path / "lost", steps, followers=2, lost=["follower_2"]))
    bare = load_run(write_run(tmp_path / "bare", [], surface=False))
    assert lost.ground is not None
    flat = replace(lost, ground=replace(lost.ground, vertices_m=lost.ground.vertices_m * (1, 1, 0)))
    for number, record in enumerate((lost, bare, flat, replace(lost, tracks={}))):
        pictures = write_pictures(record, analyse(record), tmp_path / str(number))
        assert all(picture.stat().st_size > 5000 for picture in pictures)


def test_a_picture_that_cannot_be_written_is_told(bag: Path, tmp_path: Path) -> None:
    record = load_run(bag)
    (tmp_path / "out" / "trajectory.png").mkdir(parents=True)
    with pytest.raises(AnalysisError, match="can't be written"):
        write_pictures(record, analyse(record), tmp_path / "out")


def test_analysing_without_pictures_imports_neither_matplotlib_nor_ros(bag: Path) -> None:
    program = (
        "import argparse, pathlib, sys; from robot_formation.cli import analyze; "
        f"options = dict(bag=pathlib.Path({str(bag)!r}), out=None, json=True, no_pictures=True, namespace=None); "
        "analyze.run(argparse.Namespace(**options)); "
        "print([m for m in ('matplotlib', 'rclpy', 'geometry_msgs', 'pybullet') if m in sys.modules], file=sys.stderr)"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stderr == "[]\n"
