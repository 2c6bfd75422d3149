"""`formation calibrate` as a person types it: files, JSON, what is refused, and a run that uses the curves."""

import json
import subprocess
from pathlib import Path

import pytest
from _pytest.capture import CaptureResult
from mcap.reader import make_reader

from cli_tools import complaint
from graph_tools import formation, json_of
from robot_formation.analysis.errors import AnalysisError
from robot_formation.bag.reader import read_bag
from robot_formation.calibration.encoder_comparison import Travelled, compare_distances
from robot_formation.calibration.motor_figures import draw_encoders, draw_motors
from robot_formation.calibration.motor_fit import MeasuredDrive, fit_axis
from robot_formation.calibration.motor_report import encoders_text, motors_text
from robot_formation.cli.main import main
from robot_formation.drive.curves import load_calibration

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("calibrate")]

QUICK = ("--repeats", "1")
Measured = tuple[Path, subprocess.CompletedProcess[str]]


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, CaptureResult[str]]:
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return code, captured


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    """A folder with the calibration of seed 3's robots, and what the command printed."""
    folder = tmp_path_factory.mktemp("calibration")
    completed = formation("calibrate", "motors", "--seed", 3, "--out", folder, "--json", *QUICK)
    assert completed.returncode == 0, completed.stderr
    return folder, completed


def test_motors_prints_json_only_and_stores_the_same_curves(
    measured: Measured,
) -> None:
    folder, completed = measured
    said = json_of(completed)
    assert (said["seed"], said["surface"], said["repeats"]) == (3, "plane", 1)
    assert {robot: list(axes) for robot, axes in said["robots"].items()} == {
        "leader": ["v", "turn"],
        "follower_1": ["v", "u", "turn"],
    }
    stored = load_calibration(said["file"])
    assert stored.measured_with["seed"] == 3
    for robot, axes in said["robots"].items():
        for axis, fit in axes.items():
            assert fit["unit"] == ("rad" if axis == "turn" else "m")
            assert fit["degree"] == len(fit["curve"]) - 1
            assert stored.robots[robot][axis] == pytest.approx(fit["curve"], rel=1e-7)
            assert {point["drives"] for point in fit["points"]} == {2}
            assert abs(fit["residual_max"]) >= fit["residual_rms"] > 0.0
    assert {path.name for path in folder.iterdir()} == {"motors.yaml", "motors.png"}
    assert "follower_1 u: 22 drives" in completed.stderr


def test_a_run_uses_the_stored_curves_and_says_so(measured: Measured, tmp_path: Path) -> None:
    folder, _ = measured
    file = folder / "motors.yaml"
    bag = tmp_path / "bag"
    options = ("--in-process", "--camera", "on_demand", "--set", "leader.timesteps=1", "--seed", 3, "--bag", bag)
    completed = formation("run", *options, "--set", f"drive.calibration_file={file}", "--json")
    assert completed.returncode == 0, completed.stderr
    assert f"drive curves: {file}, measured with seed 3, surface plane" in completed.stderr
    curve = load_calibration(file).robots["leader"]["v"]
    with (bag / "bag_0.mcap").open("rb") as stream:
        command = next(message.data for _, _, message in make_reader(stream).iter_messages(["/leader/joint_commands"]))
    with read_bag(bag) as opened:
        assert json.loads(opened.metadata("robot_formation")["drive_curves"])["leader"]["v"] == list(curve)
    from robot_formation import conversions

    angles = conversions.read_joint_command(conversions.from_cdr(command, "sensor_msgs/msg/JointState")).angles_rad
    expected = sum(c * 0.05**power for power, c in enumerate(curve))
    assert angles == pytest.approx((expected,) * 4)


def test_a_run_of_other_robots_refuses_the_curves(capsys: pytest.CaptureFixture[str], measured: Measured) -> None:
    line = complaint(capsys, "run", "--seed", "4", "--set", f"drive.calibration_file={measured[0] / 'motors.yaml'}")
    assert "seed 3 instead of 4" in line


def test_files_are_replaced_with_force_only(
    capsys: pytest.CaptureFixture[str], measured: Measured, tmp_path: Path
) -> None:
    before = (measured[0] / "motors.yaml").read_text()
    line = complaint(capsys, "calibrate", "motors", "--seed", "4", "--out", measured[0], *QUICK)
    assert "motors.yaml exists already" in line
    assert "--force" in line
    assert (measured[0] / "motors.yaml").read_text() == before
    (tmp_path / "motors.yaml").write_text("old")
    code, _ = call(capsys, "calibrate", "motors", "--seed", 3, "--out", tmp_path, "--force", *QUICK)
    assert code == 0
    assert (tmp_path / "motors.yaml").read_text() == before  # the same seed gives the same curves


def test_encoders_compares_the_instruments_by_the_robots_own_curves(
    capsys: pytest.CaptureFixture[str], measured: Measured, tmp_path: Path
) -> None:
    setting = f"drive.calibration_file={measured[0] / 'motors.yaml'}"
    options = ("--seed", 3, "--out", tmp_path, "--set", setting, *QUICK)
    code, captured = call(capsys, "calibrate", "encoders", *options, "--json")
    assert code == 0
    said = json.loads(captured.out)
    assert said["robot"] == "follower_1"
    assert [(row["axis"], round(row["preset_m"], 6)) for row in said["distances"]] == [
        *(("v", round(0.02 * k, 6)) for k in range(1, 11)),
        *(("u", round(0.01 * k, 6)) for k in range(1, 11)),
    ]
    for row in said["distances"]:
        assert row["sensing_m"]["mean"] == pytest.approx(row["reference_m"]["mean"], rel=0.02, abs=3e-4)
    assert "measured with seed 3" in captured.err
    code, captured = call(capsys, "calibrate", "encoders", *options, "--force", "--robot", "leader")
    assert code == 0
    assert "sensing wheels" in captured.out
    assert (tmp_path / "encoders.png").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("motors", "--track", "tow"), ["'tow'", "'two'"]),
        (("motors", "--surface", "plain"), ["'plain'", "'plane'"]),
        (("motors", "--seed", "-1"), ["seed"]),
        (("motors", "--repeats", "0"), ["--repeats", "1 to 1000"]),
        (("motors", "--repeats", "many"), ["--repeats", "1 to 1000"]),
        (("motors", "--reference-noise", "-1"), ["--reference-noise", "0.1"]),
        (("motors", "--reference-noise", "nan"), ["--reference-noise", "0.1"]),
        (("motors", "--set", "world.motor.drivemode=pid"), ["drivemode", "drive_mode"]),
        (("encoders", "--robot", "follower_2"), ["follower_2", "follower_1"]),
        (("encoders", "--set", "drive.calibration_file=missing.yaml"), ["missing.yaml", "calibrate motors"]),
        (("wheels",), ["no 'wheels'", "motors"]),
    ],
)
def test_a_mistake_is_one_line_with_a_hint_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], words: list[str]
) -> None:
    out = ("--out", tmp_path) if len(arguments) > 1 else ()
    line = complaint(capsys, "calibrate", *arguments, *out)
    for word in words:
        assert word in line
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_said_before_anything_is_measured(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    assert "can't be made" in complaint(capsys, "calibrate", "motors", "--out", tmp_path / "file" / "folder")


def test_reports_and_pictures_take_several_followers_and_bends(tmp_path: Path) -> None:
    drives = [MeasuredDrive(s * (30.0 * d + 9.0 * d * d), s * d) for d in (0.02, 0.05, 0.1, 0.15, 0.2) for s in (1, -1)]
    fit = fit_axis("v", drives)
    fits = {"leader": {"v": fit}, "follower_1": {"v": fit, "u": fit}, "follower_2": {"v": fit, "u": fit, "turn": fit}}
    text = motors_text(fits)
    assert "30.0000 d + 9.0000 d^2" in text
    assert draw_motors(fits, "title", tmp_path / "motors.png").stat().st_size > 10_000
    rows = compare_distances([Travelled(axis, 0.1, 0.1, 0.101, 0.1) for axis in ("v", "u")])
    assert "+1.00" in encoders_text(rows)
    assert draw_encoders(rows, "title", tmp_path / "encoders.png").stat().st_size > 10_000
    with pytest.raises(AnalysisError, match="can't be written"):
        draw_motors(fits, "title", tmp_path / "no" / "motors.png")
