"""The camera's calibration file: round trip into the fine-tuner, and what is refused."""

import json
from pathlib import Path

import pytest
import yaml

from robot_formation.alignment.paper_mode import AlignmentParameters, PaperAlignment
from robot_formation.calibration.camera_check import camera_facts, camera_values, check_camera, describe_camera
from robot_formation.components.base import Place
from robot_formation.components.catalogue import KINDS
from robot_formation.components.fine_tuner import FineTunerComponent
from robot_formation.drive.curves import CalibrationError, MotorCalibration, save_calibration
from robot_formation.experiment.scenario import Scenario, load_track, override
from robot_formation.follower.camera_calibration_file import (
    NAMES,
    VisionCalibration,
    calibrated,
    load_vision,
    save_vision,
)
from robot_formation.follower.fine_tuning import FineTunerParameters
from robot_formation.launching.processes import run_metadata
from robot_formation.parameters import from_mapping
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

VALUES = {
    "target_x_px": 135.0,
    "slope_px_per_m": 833.0,
    "side_px_m": 16.5,
    "side_bias_px": 1.75,
    "distance_m": 0.33,
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "vision.yaml"
    facts = {"seed": 3, "surface": "plane", **camera_facts(load_track("two").world)}
    save_vision(path, VisionCalibration(VALUES, facts))
    return path


def scenario(path: Path, *settings: str) -> Scenario:
    return override(load_track("two"), [f"fine_tuner.calibration_file={path}", *settings])


def tuned_component(path: Path) -> FineTunerComponent:
    kind = KINDS["fine_tuner"]
    parameters = scenario(path, "fine_tuner.mode=paper").of_robot(kind, "follower_1")
    found = kind.component_class()(parameters, Place("follower_1"))
    assert isinstance(found, FineTunerComponent)
    return found


def test_a_file_is_read_as_it_was_written(file: Path) -> None:
    assert load_vision(file).alignment == VALUES
    assert load_vision(file).measured_with["seed"] == 3
    assert set(yaml.safe_load(file.read_text())) == {"alignment", "measured_with"}
    assert set(NAMES) == set(VALUES)


def test_the_files_values_go_before_the_parameters_and_the_users_choices_stay(file: Path) -> None:
    own = AlignmentParameters(target_x_px=100.0, u_tolerance_m=0.02)
    got = calibrated(FineTunerParameters(calibration_file=str(file), alignment=own)).alignment
    assert {name: getattr(got, name) for name in NAMES} == VALUES
    assert got.u_tolerance_m == 0.02


def test_without_a_file_the_parameters_are_the_same_object() -> None:
    parameters = FineTunerParameters()
    assert calibrated(parameters) is parameters


def test_the_fine_tuner_node_corrects_by_the_files_curves(file: Path) -> None:
    component = tuned_component(file)
    component._tuner.neighbour_done(0)  # the node's own way there is messages
    block = Block(Face.TARGET, 175, 60, 48, 47)
    actions = []
    for number in range(1, 23):
        actions += component._tuner.frame([block], number)
    motion = next(action.motion for action in actions if hasattr(action, "motion"))
    assert motion.x_m == pytest.approx((175 - 135.0) / 833.0)


def test_a_file_may_hold_some_values_only(tmp_path: Path) -> None:
    path = tmp_path / "vision.yaml"
    path.write_text("alignment: {target_x_px: 135}\n")
    got = calibrated(FineTunerParameters(calibration_file=str(path))).alignment
    assert got == AlignmentParameters(target_x_px=135.0)
    check_camera(scenario(path).fine_tuner, scenario(path).world)  # it says nothing of its camera


def test_calibrated_offset_is_zero_where_the_curves_say_formation() -> None:
    alignment = PaperAlignment(from_mapping(AlignmentParameters, VALUES, where="test"))
    side = VALUES["side_px_m"] / VALUES["distance_m"] - VALUES["side_bias_px"]
    # Fractions of a pixel, so that the place is exact.
    offset = alignment.offset([Block(Face.TARGET, 135.0, 60, side, side)])  # type: ignore[arg-type]
    assert offset is not None
    assert (offset.x_m, offset.y_m) == pytest.approx((0.0, 0.0))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("alignment: {target_px: 135}", ["'target_px'", "'target_x_px'"]),
        ("alignment: {max_moves: 3}", ["'max_moves'", "target_x_px"]),
        ("alignment: {target_x_px: 1000}", ["target_x_px", "1000", "315"]),
        ("alignment: {target_x_px: middle}", ["target_x_px", "'middle'"]),
        ("alignment: {distance_m: .nan}", ["distance_m", "finite"]),
        ("alignment: [1, 2]", ["no camera calibration", "formation calibrate vision"]),
        ("alignment: {}", ["no camera calibration"]),
        ("{", ["no valid YAML"]),
        ("", ["no camera calibration"]),
        ("alignment: {target_x_px: 135}\nmeasured_with: 3", ["measured_with"]),
    ],
)
def test_a_wrong_file_is_told_in_a_line(tmp_path: Path, text: str, words: list[str]) -> None:
    path = tmp_path / "vision.yaml"
    path.write_text(text)
    for use in (load_vision, tuned_component):
        with pytest.raises(CalibrationError) as raised:
            use(path)
        said = str(raised.value)
        assert str(path) in said
        assert "\n" not in said
        for word in words:
            assert word in said


def test_missing_files_and_those_of_motors_name_the_verb_that_measures(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"gone\.yaml: can't be read .* 'formation calibrate vision'"):
        scenario(tmp_path / "gone.yaml").check()
    motors = tmp_path / "motors.yaml"
    save_calibration(motors, MotorCalibration({"leader": {"v": (0.0, 30.0)}}))
    with pytest.raises(CalibrationError, match="no camera calibration"):
        load_vision(motors)
    with pytest.raises(CalibrationError, match="can't be written"):
        save_vision(tmp_path / "no" / "vision.yaml", VisionCalibration(VALUES))


def test_a_run_with_another_camera_refuses_the_file_and_one_with_other_light_does_not(file: Path) -> None:
    scenario(file).check()
    scenario(file, "world.camera.illuminance_lux=200").check()
    with pytest.raises(CalibrationError, match=r"world\.camera\.pan_deg 90\.0 instead of 85\.0"):
        scenario(file, "world.camera.pan_deg=85").check()
    text = "\n".join(line for line in file.read_text().splitlines() if "pan_deg" not in line)
    file.write_text(text + "\n")
    scenario(file, "world.camera.pan_deg=85").check()


def test_a_run_says_which_calibration_it_uses_and_keeps_the_values_in_its_bag(file: Path) -> None:
    said = describe_camera(scenario(file).fine_tuner)
    assert said == f"camera calibration: {file}, measured with seed 3, surface plane"
    assert json.loads(run_metadata(scenario(file))["camera_calibration"]) == VALUES
    assert describe_camera(load_track("two").fine_tuner) == ""
    assert camera_values(load_track("two").fine_tuner) == {}
