"""`formation calibrate vision` as a person types it: grid, table, bag, pictures, going on, and what is refused."""

import contextlib
import csv
import io
import json
import math
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.capture import CaptureResult

from cli_tools import complaint
from robot_formation import conversions
from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.alignment.precise.marker_edges import EdgeParameters
from robot_formation.bag.reader import read_bag
from robot_formation.calibration import camera_run, camera_table
from robot_formation.calibration.camera_grid import ANGLES_DEG, Position, measure, positions, true_faces
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.calibration.camera_table import TableRow, VisionTable, read_table
from robot_formation.cli.calibrate_vision import conditions_of
from robot_formation.cli.main import main
from robot_formation.drive.curves import CalibrationError
from robot_formation.experiment.scenario import load_track, override
from robot_formation.follower.camera_calibration_file import load_vision
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("calibrate_vision")]

QUICK = ("--step", "0.45", "--jobs", "1")
FILES = {"vision.csv", "vision.json", "vision.yaml", "vision_bag"} | {
    f"vision_{name}.png" for name in ("areas", "pan", "side")
}


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, CaptureResult[str]]:
    code = main(["calibrate", "vision", *map(str, arguments)])
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return code, captured


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("vision")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        assert main(["calibrate", "vision", "--seed", "3", "--out", str(folder), *QUICK]) == 0
    assert "areas, all relative angles overlaid" in said.getvalue()
    assert f"fine_tuner.calibration_file={folder / 'vision.yaml'}" in said.getvalue()
    return folder


def test_the_papers_grid_is_complete_and_the_finer_sets_lie_beside_the_neighbour() -> None:
    places = positions(0.05, 0.238)
    grid = [place for place in places if place.angles_deg == ANGLES_DEG]
    assert len(grid) * len(ANGLES_DEG) == 19 * 19 * 9
    assert {place.u_m for place in grid} == {round(0.05 * k, 6) for k in range(-9, 10)}
    finer = [place for place in places if place.angles_deg == (0.0,)]
    assert len(grid) + len(finer) == len(places) == len({(p.u_m, p.v_m) for p in places})
    assert all(place.u_m > 0.238 and abs(place.v_m) <= 0.1 for place in finer)
    assert {round(place.v_m * 200) for place in finer if place.u_m == 0.3} == set(range(-20, 21)) - {
        -20,
        -10,
        0,
        10,
        20,
    }


@pytest.mark.parametrize("step", [0.07, 0.0, -0.05, math.nan, math.inf, 0.001, 1.0])
def test_a_step_that_does_not_divide_the_grid_is_refused(step: float) -> None:
    with pytest.raises(CalibrationError, match="whole steps"):
        positions(step, 0.238)


def test_a_look_sees_the_face_where_the_pinhole_projects_it_and_nothing_where_robots_overlap() -> None:
    conditions = conditions_of(override(load_track("two"), ["world.surface=plane"]))
    straight, turned = measure(Position(0.3, 0.02, (0.0, 60.0)), conditions)
    assert not turned.attainable  # the body's corner is 21.8 cm from its middle, 30 - 11.9 are free
    assert turned.blocks == ()
    (block,) = straight.blocks
    assert block.signature == 1
    assert block.x == pytest.approx(157.5 - 273.7 * 0.02 / 0.308, abs=2.5)
    assert block.width == pytest.approx(273.7 * 0.06 / 0.308, abs=4.0)
    assert straight.frames == 32  # block filtering 40 shows a block in frame 21, and the last three must agree


def test_the_true_faces_are_those_of_the_pinhole() -> None:
    world = conditions_of(override(load_track("two"), ["world.surface=plane"])).world
    faces = true_faces(world, CameraSample(0.3, 0.02, 0.0, True))
    columns = [157.5 + 273.7 * (x - 0.02) / 0.308 for x in (-0.03, 0.03)]
    rows = [103.5 - 273.7 * (z - 0.126) / 0.308 for z in (0.216, 0.156)]
    assert faces[Face.TARGET] == pytest.approx(np.array([[column, row] for column in columns for row in rows]))
    ahead = true_faces(world, CameraSample(0.3, 0.05, 0.0, True))[Face.FRONT]
    assert ahead[0, 0] == pytest.approx(157.5 - 273.7 * 0.02 / 0.308)
    assert ahead[2, 0] == pytest.approx(157.5 - 273.7 * 0.02 / 0.368)
    assert 2 not in true_faces(world, CameraSample(-0.02, 0.2, 0.0, True))  # it reaches behind the lens


def test_a_look_depends_on_seed_and_position_only() -> None:
    first, second = (conditions_of(override(load_track("two"), ["world.surface=plane", f"seed={n}"])) for n in (1, 2))
    places = [Position(0.4, 0.1, (0.0, 15.0)), Position(0.45, 0.12, (0.0, 15.0))]
    forward = [measure(place, first) for place in places]
    assert [measure(place, first) for place in reversed(places)] == forward[::-1]
    assert measure(places[1], second)[0].blocks  # another seed's noise, the same scene


def test_the_files_agree_with_each_other_and_with_the_nodes_defaults(
    measured: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert {path.name for path in measured.iterdir()} == FILES
    code, captured = call(capsys, "--seed", 3, "--out", measured, *QUICK, "--json")
    assert code == 0
    assert captured.err == ""  # nothing is left to look at
    said = json.loads(captured.out)
    assert load_vision(said["file"]).alignment == pytest.approx(said["alignment"], rel=1e-5)
    defaults = AlignmentParameters()
    for name, error in said["standard_errors"].items():
        if name in said["alignment"] and name != "side_bias_px":  # the default takes it with another side_px_m
            assert abs(said["alignment"][name] - getattr(defaults, name)) < 4.0 * error, name
    rows = list(csv.DictReader((measured / "vision.csv").read_text().splitlines()))
    assert list(rows[0]) == [field.name for field in fields(TableRow)]
    table = list(read_table(measured / "vision.csv"))
    assert said["looks"] == {
        "poses": len(table),
        "attainable": sum(s.attainable for s in table),
        "with_blocks": sum(bool(s.blocks) for s in table),
    }
    assert sum(said["areas"].values()) == len(said["positions"]) == 9
    assert {(p["u_m"], p["v_m"]): p["area"] for p in said["positions"]}[0.45, 0.0] == "target"
    assert said["pan"]["window_px"][1] - said["pan"]["window_px"][0] == pytest.approx(50.0, abs=3.0)
    assert abs(said["edges"]["target_left_px"]["mean_px"] - EdgeParameters().target_left_px) < 1.0
    for picture in said["pictures"].values():
        assert (measured / picture).stat().st_size > 10_000


def test_the_bag_holds_every_attainable_look_with_both_true_poses(measured: Path) -> None:
    looked = [s for s in read_table(measured / "vision.csv") if s.attainable]
    topics = {name: f"/ground_truth/{name}/odom" for name in ("leader", "follower_1")}
    with read_bag(measured / "vision_bag") as bag:
        assert json.loads(bag.metadata("robot_formation")["conditions"])["seed"] == 3
        found = [m.message for m in bag.messages(["/follower_1/blocks"])]
        poses = {name: [m.message.pose.pose for m in bag.messages([topic])] for name, topic in topics.items()}
    assert len(found) == len(looked)
    order = {(p.u_m, p.v_m): n for n, p in enumerate(positions(0.45, 0.238))}
    looked.sort(key=lambda s: (order[s.u_m, s.v_m], s.clockwise_deg))
    for sample, message, leader, follower in zip(looked, found, *poses.values(), strict=True):
        points = np.frombuffer(message.data, conversions.BLOCK_DTYPE)
        assert [Block(*map(int, point)) for point in points] == list(sample.blocks)
        # The pair heads along +y: ahead is +y, right is +x.
        offset = (follower.position.x - leader.position.x, follower.position.y - leader.position.y)
        assert offset == pytest.approx((sample.u_m, sample.v_m), abs=1e-9)
        yaw = 2.0 * math.atan2(follower.orientation.z, follower.orientation.w)
        assert math.degrees(math.remainder(math.pi / 2 - yaw, math.tau)) == pytest.approx(sample.clockwise_deg)


def test_a_stopped_calibration_goes_on_where_it_was_and_ends_the_same(
    measured: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = {path.name: path.read_bytes() for path in measured.iterdir() if path.is_file()}
    carry_out = camera_run.carry_out

    def stopped(*arguments: Any) -> Iterator[Any]:
        for number, found in enumerate(carry_out(*arguments)):
            if number == 5:
                raise KeyboardInterrupt
            yield found

    with monkeypatch.context() as patch:
        patch.setattr(camera_run, "carry_out", stopped)
        code, captured = call(capsys, "--seed", 3, "--out", tmp_path, *QUICK)
    assert code == 130
    assert captured.out == ""
    assert "goes on" in captured.err
    assert {path.name for path in tmp_path.iterdir()} == {"vision.csv", "vision.json"}
    table = tmp_path / "vision.csv"
    table.write_text(table.read_text()[:-40])  # its last position was being written
    code, captured = call(capsys, "--seed", 3, "--out", tmp_path, *QUICK)
    assert code == 0
    assert f"{table}: 4 positions are there already, 13 are left" in captured.err
    for name in ("vision.csv", "vision.json", "vision.yaml"):
        assert (tmp_path / name).read_bytes() == whole[name], name
    with read_bag(measured / "vision_bag") as one, read_bag(tmp_path / "vision_bag") as other:
        assert one.message_count == other.message_count


def test_other_conditions_need_another_folder_or_force(
    measured: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    line = complaint(capsys, "calibrate", "vision", "--seed", "4", "--out", measured, *QUICK)
    assert "seed 3 instead of 4" in line
    assert "--force" in line
    record, table = tmp_path / "vision.json", tmp_path / "vision.csv"
    table.write_text("u_m\n")
    assert "without its record" in complaint(capsys, "calibrate", "vision", "--out", tmp_path, *QUICK)
    record.write_text("[")
    assert "no record" in complaint(capsys, "calibrate", "vision", "--out", tmp_path, *QUICK)
    assert record.read_text() == "["  # nothing was replaced


def test_a_table_keeps_whole_positions_only_and_damaged_lines_are_told(tmp_path: Path) -> None:
    places = [Position(0.3, 0.0, (0.0, 15.0)), Position(0.4, 0.0, (0.0, 15.0))]
    samples = [
        [
            CameraSample(p.u_m, p.v_m, a, True, 22, (Block(1, 150, 60, 40, 40, 0, 3, 1),) * n)
            for n, a in enumerate((0.0, 15.0))
        ]
        for p in places
    ]
    table = VisionTable(tmp_path, {"seed": 1}, places)
    for found in samples:
        table.add(found)
    assert table.all(places) == [s for found in samples for s in found]
    lines = table.path.read_text().splitlines(keepends=True)
    table.path.write_text("".join(lines[:-1]))
    again = VisionTable(tmp_path, {"seed": 1}, places)
    assert again.remaining(places) == [places[1]]
    table.path.write_text(lines[0] + "0.3,0.0,0.0,1,many,,,,,,,,\n")
    with pytest.raises(CalibrationError, match="line 2"):
        list(read_table(table.path))


def test_a_dead_worker_is_told_in_a_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def died(position: object, conditions: object) -> None:
        raise BrokenExecutor

    monkeypatch.setattr(camera_run, "measure", died)
    assert "worker process died" in complaint(capsys, "calibrate", "vision", "--out", tmp_path, *QUICK)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--step", "0.07"), ["0.07", "0.45"]),
        (("--step", "wide"), ["--step", "'wide'"]),
        (("--jobs", "0"), ["--jobs", "at least 1"]),
        (("--seed", "-1"), ["seed"]),
        (("--surface", "plain"), ["'plain'", "'plane'"]),
        (("--set", "world.camera.pan=3"), ["camera.pan", "camera.pan_deg"]),
        (("--set", "block_detector.signatures_file=gone.yaml"), ["gone.yaml", "formation teach"]),
        (("--scenario", "gone.yaml"), ["gone.yaml"]),
        (("--repeats", "3"), ["--repeats"]),
    ],
)
def test_a_mistake_is_one_line_with_a_hint_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, str], words: list[str]
) -> None:
    line = complaint(capsys, "calibrate", "vision", "--out", tmp_path / "new", *arguments)
    for word in words:
        assert word in line
    assert list(tmp_path.iterdir()) == []


def test_a_camera_that_never_sees_the_marker_keeps_its_table_and_says_what_is_missing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for name in ("vision.csv", "vision.json", "vision.yaml"):
        (tmp_path / name).write_text("of an older calibration")
    (tmp_path / "vision_bag.partial").mkdir()
    setting = ("--force", "--set", "world.camera.pan_deg=-90")
    line = complaint(capsys, "calibrate", "vision", "--out", tmp_path, *setting, *QUICK)
    assert "is the marker in view" in line
    assert {"vision.csv", "vision_areas.png", "vision_bag"} <= {path.name for path in tmp_path.iterdir()}
    assert "vision.yaml" not in {path.name for path in tmp_path.iterdir()}


def test_the_record_names_what_results_depend_on_and_nothing_else() -> None:
    record = camera_run.record_of(conditions_of(load_track("two")), 0.05)
    assert {"seed", "step_m", "world.surface", "world.camera.gamma", "block_detector.block_filtering"} <= set(record)
    assert not [name for name in record if name.startswith(("world.motor", "fine_tuner.alignment"))]
    assert camera_table.RECORD_NAME == "vision.json"
