"""Calibration files: each drive takes its own robot's section, and files of other robots are refused."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml

from robot_formation.calibration.drive_check import describe_curves, robot_curves, robot_facts
from robot_formation.components.base import Place
from robot_formation.components.drive import DriveComponent
from robot_formation.drive.curves import (
    CalibrationError,
    MotorCalibration,
    calibrated,
    load_calibration,
    save_calibration,
)
from robot_formation.drive.movement_system import CalibrationParameters, DriveParameters
from robot_formation.experiment.scenario import Scenario, load_track, override
from robot_formation.launching.processes import run_metadata
from robot_formation.names import Topic

CURVES: dict[str, dict[str, tuple[float, ...]]] = {  # at 10 cm: 3.4 rad and 2.9 rad
    "leader": {"v": (-0.1, 35.0)},
    "follower_1": {"v": (-0.2, 31.0), "u": (-0.3, 32.0, 1.5), "turn": (-0.4, 7.0)},
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "motors.yaml"
    save_calibration(path, MotorCalibration(CURVES, {"seed": 0, "surface": "plane"}))
    return path


def with_file(path: Path, **values: Any) -> DriveParameters:
    return DriveParameters(calibration_file=str(path), **values)


def scenario(path: Path, *settings: str) -> Scenario:
    return override(load_track("two"), [f"drive.calibration_file={path}", *settings])


def test_a_file_is_read_as_it_was_written(file: Path) -> None:
    read = load_calibration(file)
    assert read.robots == CURVES
    assert read.measured_with == {"seed": 0, "surface": "plane"}


def test_the_files_comment_is_all_that_a_yaml_reader_does_not_see(file: Path) -> None:
    assert set(yaml.safe_load(file.read_text())) == {"robots", "measured_with"}
    assert file.read_text().startswith("# ")


def test_each_robot_gets_its_own_curves_and_keeps_the_parameters_where_the_file_has_none(file: Path) -> None:
    own = CalibrationParameters(v=(0.0, 1.0), u=(0.0, 2.0), turn=(0.0, 3.0))
    leader = calibrated(with_file(file, calibration=own), "leader").calibration
    assert leader == CalibrationParameters(v=(-0.1, 35.0), u=(0.0, 2.0), turn=(0.0, 3.0))
    assert calibrated(with_file(file), "follower_1").calibration == CalibrationParameters(**CURVES["follower_1"])


def test_without_a_file_nothing_changes() -> None:
    parameters = DriveParameters()
    assert calibrated(parameters, "leader") is parameters


def test_the_drive_component_drives_by_its_own_section(file: Path) -> None:
    from robot_formation import conversions
    from robot_formation.geometry.se2 import Motion

    sent: dict[str, Any] = {}

    def keep(robot: str, topic: Topic, message: Any) -> None:
        sent[robot] = message

    for robot in ("leader", "follower_1"):
        component = DriveComponent(with_file(file), Place(robot))
        component.attach(partial(keep, robot), lambda level, text: None)
        move = next(entry for entry in component.inputs() if entry.topic.name == "move")
        move.handler(conversions.move(Motion(x_m=0.1), "base_link", 0))
        assert component.details()["calibration"] == str(file)
    assert conversions.read_joint_command(sent["leader"]).angles_rad == pytest.approx((3.4,) * 4)
    assert conversions.read_joint_command(sent["follower_1"]).angles_rad == pytest.approx((2.9,) * 4)


def test_a_robot_that_the_file_lacks_is_refused(file: Path) -> None:
    with pytest.raises(CalibrationError, match=r"no robot 'follower_2', only leader, follower_1"):
        DriveComponent(with_file(file), Place("follower_2"))
    with pytest.raises(CalibrationError, match="follower_2"):
        scenario(file, "followers=2", "world.surface_parameters=['size_m=3.0']").check()


def test_robots_of_another_seed_or_make_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "motors.yaml"
    robots = load_track("two")
    facts = {"surface": "plane", **robot_facts(robots.drive, robots.world)}
    save_calibration(path, MotorCalibration(CURVES, facts))
    scenario(path).check()
    scenario(path, "predictor.name=previous", "world.surface=bowl", "world.camera.mode=on_demand").check()
    for setting, words in (
        ("seed=5", "seed 0 instead of 5"),
        ("world.motor.drive_mode=pid", "world.motor.drive_mode pwm_stop instead of pid"),
        ("drive.wheel_speed_rad_s=2.0", r"drive.wheel_speed_rad_s 4.0 instead of 2.0"),
    ):
        with pytest.raises(CalibrationError, match=words) as caught:
            scenario(path, setting).check()
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)


def test_a_file_that_does_not_say_how_it_was_measured_is_taken_for_any_robots(tmp_path: Path) -> None:
    path = tmp_path / "motors.yaml"
    save_calibration(path, MotorCalibration(CURVES))
    scenario(path, "seed=5").check()


def test_a_run_says_and_records_which_curves_it_uses(file: Path) -> None:
    import json

    assert describe_curves(scenario(file).drive) == f"drive curves: {file}, measured with seed 0, surface plane"
    assert "drive.calibration" in describe_curves(load_track("two").drive)
    recorded = json.loads(run_metadata(scenario(file))["drive_curves"])
    assert recorded["leader"]["v"] == [-0.1, 35.0]
    assert recorded == json.loads(json.dumps(robot_curves(scenario(file).drive, scenario(file).robots)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no motor calibration"),
        ("[1, 2]", "no motor calibration"),
        ("robots: {}", "no motor calibration"),
        ("robots: {leader: 3}", "needs curves"),
        ("robots: {leader: {}}", "needs curves"),
        ("robots: {leader: {w: [0, 33]}}", "no axis 'w'"),
        ("robots: {leader: {v: 33}}", "list"),
        ("robots: {leader: {v: [33]}}", "2 to 8"),
        ("robots: {leader: {v: '12'}}", "finite numbers"),
        ("robots: {leader: {v: [0, .nan]}}", "finite"),
        ("robots: {leader: {v: [0, true]}}", "finite"),
        ("robots: {leader: {v: [0, -33]}}", "doesn't rise"),
        ("robots: {leader: {v: [0, 33, -200]}}", "doesn't rise"),
        ("robots: {leader: {v: [-9, 33]}}", "doesn't rise"),
        ("robots: {leader: {v: [0, 33]}}\nmeasured_with: 3", "measured_with"),
        ("a: [1", "no valid YAML"),
        ("robots: !!python/object/apply:os.system ['true']", "no valid YAML"),
    ],
)
def test_a_wrong_file_is_one_line_that_names_it(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "motors.yaml"
    path.write_text(text)
    with pytest.raises(CalibrationError, match=words) as caught:
        calibrated(with_file(path), "leader")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_files_and_folders_are_said(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"missing.*No such file"):
        load_calibration(tmp_path / "missing.yaml")
    with pytest.raises(CalibrationError, match="can't be written"):
        save_calibration(tmp_path / "no" / "motors.yaml", MotorCalibration(CURVES))
