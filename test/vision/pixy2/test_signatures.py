"""Teaching and files of signatures."""

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.parameters import ParameterError, from_mapping
from robot_formation.vision.pixy2.color_table import run_time_bounds
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.signatures import (
    Signature,
    SignatureError,
    load_signatures,
    save_signatures,
    teach_point,
    teach_region,
)
from robot_formation.vision.pixy2.teaching import bounds, truncated
from vision_helpers import EXAMPLES, GROUPS, RED, canvas


def noisy(image: npt.NDArray[np.uint8], seed: int = 0, sigma: float = 3.0) -> npt.NDArray[np.uint8]:
    noise = np.random.default_rng(seed).normal(0, sigma, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(-32768, 32768), min_size=1, max_size=200))
def test_bounds_are_the_percentiles_and_odd(values: list[int]) -> None:
    low, high, middle = bounds(np.array(values))
    ordered = sorted(values)
    assert low % 2 == high % 2 == 1
    assert abs(low - ordered[len(values) // 5]) <= 1 or abs(low - ordered[max(len(values) // 5 - 1, 0)]) <= 1
    assert abs(middle - (low + high) / 2) <= 1


@given(st.integers(-(10**9), 10**9), st.integers(1, 10**6))
def test_divisions_truncate_toward_zero(numerator: int, denominator: int) -> None:
    assert truncated(numerator, denominator) == int(abs(numerator) // denominator) * (1 if numerator >= 0 else -1)


def test_a_taught_color_is_found_again() -> None:
    image = noisy(canvas(((100, 60, 60, 60), RED)))
    signature = teach_region(image, (110, 70, 40, 40), 1)
    (box,) = BlockDetector([signature], DetectorParameters(signature_range=(8.0,))).detect(image)
    assert box.left == 100
    assert abs(box.x - 130) <= 3
    assert abs(box.y - 90) <= 2


def test_growing_from_a_point_stays_on_the_patch() -> None:
    image = noisy(canvas(((100, 60, 60, 60), RED)))
    _, blocks = teach_point(image, (130, 90), 3700, 1)
    assert len(blocks) == len(set(blocks)) == 14 * 14
    assert all(x >= 98 and x + 4 <= 162 and y >= 58 and y + 4 <= 122 for x, y in blocks)


@pytest.mark.parametrize("point", [(0, 0), (315, 207), (2, 104), (158, 205), (313, 1)])
def test_growing_from_the_frame_edge_works(point: tuple[int, int]) -> None:
    signature, blocks = teach_point(noisy(canvas(background=RED)), point, 3700, 2)
    assert signature.sig == 2
    assert len(blocks) > 3000
    assert all(0 <= x <= 312 and 0 <= y <= 204 for x, y in blocks)


@pytest.mark.parametrize("region", [(-1, 0, 10, 10), (310, 0, 10, 10), (0, 200, 10, 10), (5, 5, 0, 10)])
def test_a_region_outside_the_picture_is_refused(region: tuple[int, int, int, int]) -> None:
    with pytest.raises(SignatureError, match="not inside"):
        teach_region(canvas(), region, 1)


def test_a_point_outside_the_picture_is_refused() -> None:
    with pytest.raises(SignatureError, match="not inside"):
        teach_point(canvas(), (316, 0), 3700, 1)


def test_a_dark_place_and_a_wrong_number_are_refused() -> None:
    with pytest.raises(SignatureError, match="too dark"):
        teach_region(canvas(background=(9, 9, 9)), (0, 0, 20, 20), 1)
    with pytest.raises(SignatureError, match="from 1 to 7"):
        teach_region(canvas(), (0, 0, 20, 20), 8)


def test_the_whole_picture_may_be_taught() -> None:
    assert teach_region(noisy(canvas(background=RED)), (0, 0, 316, 208), 1).rgb >> 16 in range(194, 198)


def test_code_signatures_have_one_and_a_half_times_the_range() -> None:
    signature = Signature(1, -101, 101, 0, -11, 11, 0)
    assert run_time_bounds(signature, 2.0) == (-202, 202, -22, 22)
    assert run_time_bounds(signature, 2.0, code=True) == (-303, 303, -33, 33)


def test_a_signature_with_both_bounds_zero_counts_as_not_set() -> None:
    unset = Signature(1, 0, 0, 0, 0, 0, 0)
    assert BlockDetector([unset]).detect(canvas(background=RED)) == []


def test_a_signature_that_is_given_twice_is_refused() -> None:
    with pytest.raises(SignatureError, match="twice"):
        BlockDetector([GROUPS["G1"][0], GROUPS["G1"][0]])


@pytest.mark.parametrize("name", ["colors.yaml", "colors.json"])
def test_files_of_signatures_come_back_unchanged(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    save_signatures(path, reversed(GROUPS["G2"]))
    assert load_signatures(path) == GROUPS["G2"]


def test_a_group_of_the_examples_is_a_file_of_signatures(tmp_path: Path) -> None:
    path = tmp_path / "group.json"
    path.write_text(json.dumps(EXAMPLES["groups"]["G3"]))
    assert load_signatures(path) == GROUPS["G3"]


GOOD = "{sig: 1, uMin: 1, uMax: 3, uMean: 2, vMin: 1, vMax: 3, vMean: 2}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no signatures"),
        ("signatures: []", "holds no signatures"),
        ("signatures: 5", "holds no signatures"),
        ("- 1", "holds no signatures"),
        ("signatures: [5]", "must be a mapping"),
        ("signatures: [{sig: 1}]", "lacks uMin"),
        (f"signatures: [{GOOD[:-1]}, speed: 2}}]", "no 'speed'"),
        (f"signatures: [{GOOD.replace('uMin: 1', 'uMin: 1.5')}]", "must be an integer"),
        (f"signatures: [{GOOD.replace('sig: 1', 'sig: true')}]", "must be an integer"),
        (f"signatures: [{GOOD.replace('sig: 1', 'sig: 9')}]", "from 1 to 7"),
        (f"signatures: [{GOOD[:-1]}, type: 4}}]", "type 4"),
        (f"signatures: [{GOOD[:-1]}, rgb: -1}}]", "rgb -1"),
        (f"signatures: [{GOOD.replace('uMin: 1', 'uMin: 99999999999')}]", "32 bits"),
        (f"signatures: [{GOOD.replace('uMin: 1', 'uMin: 0x' + 'f' * 5000)}]", "larger than any number"),
        (f"signatures: [{GOOD.replace('sig: 1', 'sig: 0x' + 'f' * 5000)}]", "larger than any number"),
        (f"signatures: [{GOOD}, {GOOD}]", "twice"),
        ("signatures: [", "no valid YAML"),
        ("a: !!python/name:os.system", "no valid YAML"),
        ("\x00\xff", "no valid YAML"),
        ("[" * 5000, "no valid YAML"),
    ],
)
def test_a_bad_file_is_refused_in_one_line_that_names_it(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(SignatureError, match=message) as error:
        load_signatures(path)
    assert "bad.yaml" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_and_a_missing_folder_are_said(tmp_path: Path) -> None:
    with pytest.raises(SignatureError, match="can't be read"):
        load_signatures(tmp_path / "none.yaml")
    with pytest.raises(SignatureError, match="can't be written"):
        save_signatures(tmp_path / "none" / "colors.yaml", GROUPS["G1"])


def test_defaults_are_the_cameras_own() -> None:
    assert DetectorParameters() == from_mapping(
        DetectorParameters, {**EXAMPLES["parameters"]["default"], "signature_range": [3.5] * 7}, where="default"
    )


def test_missing_ranges_are_the_default_and_too_many_are_refused() -> None:
    assert DetectorParameters(signature_range=(5.0,)).range_of(2) == 3.5
    with pytest.raises(ParameterError, match="signature_range"):
        from_mapping(DetectorParameters, {"signature_range": [1.0] * 8}, where="test")
