"""Warnings about taught signatures, the mask of matching pixels, drawings, and pictures of another shape."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from robot_formation.cli.main import main
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_drawing import write_drawn
from robot_formation.vision.pixy2.color_table import ColorTable
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.matches import matching_signatures
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.scaling import scaled
from robot_formation.vision.pixy2.scanner import Scanner
from robot_formation.vision.pixy2.signature_quality import LEAST_LEVELS, shortcomings
from robot_formation.vision.pixy2.signatures import Signature, save_signatures, teach_point, teach_region
from vision_helpers import BLUE, GREEN, GROUPS, PARAMETERS, RED, canvas, picture, stored_picture

DEFAULT = DetectorParameters()


def noisy(image: npt.NDArray[np.uint8], sigma: float = 2.0) -> npt.NDArray[np.uint8]:
    noise = np.random.default_rng(1).normal(0.0, sigma, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


SCENE = noisy(canvas(((40, 60, 60, 60), RED), ((130, 60, 60, 60), GREEN), ((220, 60, 60, 60), BLUE)))


def kinds(
    signature: Signature,
    image: npt.NDArray[np.uint8] = SCENE,
    others: Sequence[Signature] = (),
    **changes: Any,
) -> list[str]:
    parameters = dataclasses.replace(DEFAULT, **changes)
    return [found.kind for found in shortcomings(signature, others, image, parameters)]


@pytest.mark.parametrize("x", [50, 140, 230])
def test_a_saturated_face_taught_on_a_noisy_picture_is_all_right(x: int) -> None:
    assert kinds(teach_region(SCENE, (x, 70, 40, 40), 1)) == []


def test_grey_is_told_from_a_region_and_from_a_point() -> None:
    assert "grey" in kinds(teach_region(SCENE, (40, 140, 60, 40), 1))
    signature, _ = teach_point(SCENE, (158, 20), DEFAULT.signature_teach_threshold, 1)
    assert kinds(signature) == ["grey", "fills"]


def test_an_interval_that_reaches_grey_is_told() -> None:
    pale = noisy(canvas(((40, 60, 60, 60), (160, 110, 110))), 6.0)
    signature = teach_region(pale, (50, 70, 40, 40), 1)
    assert kinds(signature, pale) == []
    assert "grey" in kinds(signature, pale, signature_range=(25.0,))


def test_a_picture_without_noise_teaches_too_narrow_a_signature() -> None:
    clean = canvas(((40, 60, 60, 60), RED))
    assert kinds(teach_region(clean, (50, 70, 40, 40), 1), clean) == ["narrow"]


@pytest.mark.parametrize(
    ("levels", "noise", "found"),
    [(0.25 * LEAST_LEVELS, 1.0, False), (LEAST_LEVELS, 0.5, True), (LEAST_LEVELS, 1.0, True)],
)
@pytest.mark.parametrize("color", [RED, GREEN, BLUE])
def test_the_least_width_is_what_a_camera_needs_to_find_a_face(
    levels: float, noise: float, found: bool, color: tuple[int, int, int]
) -> None:
    clean = canvas(((120, 60, 60, 60), color))
    half = levels * (1 << 15) / sum(color) / 2.0 / DEFAULT.range_of(1)
    taught = teach_region(clean, (130, 70, 40, 40), 1)
    signature = dataclasses.replace(
        taught,
        u_min=round(taught.u_mean - half),
        u_max=round(taught.u_mean + half),
        v_min=round(taught.v_mean - half),
        v_max=round(taught.v_mean + half),
    )
    detector = BlockDetector([signature], dataclasses.replace(DEFAULT, block_filtering=0))
    image = noisy(clean, noise)
    detector.process(image, 0)
    assert any(block.width > 40 and block.height > 40 for block in detector.process(image, 16_200)) == found


def test_a_region_over_two_colours_and_a_large_range_are_too_wide() -> None:
    assert "wide" in kinds(teach_region(SCENE, (70, 70, 100, 40), 1))
    assert "wide" in kinds(teach_region(SCENE, (50, 70, 40, 40), 1), signature_range=(25.0,))


def test_signatures_that_overlap_at_their_ranges_are_told_and_who_wins() -> None:
    red = teach_region(SCENE, (50, 70, 40, 40), 2)
    again = dataclasses.replace(red, sig=1)
    green = teach_region(SCENE, (140, 70, 40, 40), 3)
    (found,) = shortcomings(red, [green, again], SCENE, DEFAULT)
    assert found.kind == "overlap"
    assert found.text.startswith("overlaps signature 1 by 100 % of the smaller one: signature 1 gets what both claim")
    assert kinds(red, others=[green, red]) == []


def test_a_colour_of_most_of_the_picture_is_told() -> None:
    wall = noisy(canvas(((0, 0, 316, 208), RED)))
    assert kinds(teach_region(wall, (50, 70, 40, 40), 1), wall) == ["fills"]


# --- teach, detect ----------------------------------------------------------------------------------------------------


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.png"
    cv2.imwrite(str(path), SCENE[:, :, ::-1])
    return path


def call(capsys: pytest.CaptureFixture[str], *words: Any) -> tuple[int, Any]:
    code = main([str(word) for word in words])
    return code, capsys.readouterr()


def test_teach_warns_on_standard_error_and_in_json_and_stores_all_the_same(
    capsys: pytest.CaptureFixture[str], scene: Path, tmp_path: Path
) -> None:
    out = tmp_path / "taught.yaml"
    code, said = call(capsys, "teach", scene, "--point", "158,20", "--out", out, "--json")
    assert code == 0
    found = json.loads(said.out)
    assert [warning["kind"] for warning in found["warnings"]] == ["grey", "fills"]
    lines = said.err.splitlines()
    assert len(lines) == 2
    assert all(line.startswith("warning: signature 1: ") for line in lines)
    assert out.exists()
    code, said = call(capsys, "teach", scene, "--region", "50,70,40,40", "--signature", 2, "--json")
    assert (code, said.err, json.loads(said.out)["warnings"]) == (0, "", [])
    call(capsys, "teach", scene, "--region", "50,70,40,40", "--signature", 2, "--out", out)
    said = call(capsys, "teach", scene, "--region", "50,70,40,40", "--signature", 3, "--out", out)[1]
    assert "overlaps signature 2" in said.err


def test_the_mask_shows_what_matches(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    save_signatures(tmp_path / "s.yaml", GROUPS["G1"])
    image = picture("seqA_20.webp")
    cv2.imwrite(str(tmp_path / "image.png"), image[:, :, ::-1])
    words = ("detect", tmp_path / "image.png", "--signatures", tmp_path / "s.yaml", "--mask", tmp_path / "mask.png")
    code, said = call(capsys, *words)
    assert (code, said.err) == (0, "")
    mask = stored_picture(tmp_path / "mask.png")[1::3, 1::3]
    matched = matching_signatures(image, ColorTable.of(GROUPS["G1"], DEFAULT))
    shown = np.ones(matched.shape, bool)
    shown[-14:] = False  # below is the legend
    colours = {tuple(colour) for colour in mask[shown & (matched == 1)].tolist()}
    assert colours == {(0, 159, 230)}
    grey = mask[shown & (matched == 0)]
    assert (grey == grey[:, :1]).all()
    assert grey.max() < 0.4 * 255
    assert mask[-12:].max() > 150


@pytest.mark.parametrize("name", ["seqA_20.webp", "G1_19_distractors.webp", "G1_04_perspective.webp"])
def test_matching_pixels_hold_every_hit_of_the_scanner(name: str) -> None:
    table = ColorTable.of(GROUPS["G1"], PARAMETERS["paper"])
    matched = matching_signatures(picture(name), table)[:, ::2]
    segments = Scanner(table).scan(picture(name))
    assert len(segments.row)
    for signature, row, start, end in zip(*segments, strict=True):
        assert signature in matched[row, max(0, start - 1) : end + 1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nope.png",), "nope.png: can't be read"),
        ((".",), ".: can't be read"),
        (("scene.png", "nope.png", "--signatures", "s.yaml"), "nope.png: can't be read"),
        (("scene.png", "--signatures", "s.yaml", "--mask", "mask.jpg"), "end the name 'mask.jpg' with .png"),
        (("scene.png", "scene.png", "--signatures", "s.yaml", "--mask", "m.png"), "--mask takes one image, not 2"),
        (("scene.png", "--sensor", "tags", "--mask", "m.png"), "--mask shows what colours match"),
        (("scene.png", "--signatures", "s.yaml", "--mask", "no/m.png"), "no/m.png: can't be written"),
        (("scene.png",), "--signatures FILE"),
    ],
)
def test_the_first_thing_that_is_wrong_is_said(
    capsys: pytest.CaptureFixture[str],
    scene: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(scene.parent)
    save_signatures("s.yaml", GROUPS["G1"])
    code, said = call(capsys, "detect", *words)
    assert (code, said.out) == (2, "")
    assert message in said.err
    assert said.err.count("\n") == 1


# --- drawings and shapes ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [0, 128, 255])
def test_outlines_and_labels_stand_out_from_any_ground(tmp_path: Path, level: int) -> None:
    ground = np.full((208, 316, 3), level, np.uint8)
    write_drawn(tmp_path / "drawn.png", ground, [Block(1, 158, 104, 60, 40, 0, 3, 9)])
    image = stored_picture(tmp_path / "drawn.png").astype(int)
    inside = image[312, 3 * 128 - 8 : 3 * 128 + 9]  # across the left side
    assert {tuple(pixel) for pixel in inside.tolist()} == {(level,) * 3, (0, 0, 0), (0, 159, 230)}
    assert sum(tuple(pixel) == (0, 159, 230) for pixel in inside.tolist()) >= 3
    label = image[3 * 84 - 26 : 3 * 84 - 4, 3 * 128 + 3 : 3 * 128 + 60]
    assert (label.sum(axis=2) < 60).mean() > 0.3  # ground
    assert (label.sum(axis=2) > 300).mean() > 0.1  # letters


@pytest.mark.parametrize("place", [(0, 0), (315, 0), (0, 207), (315, 207), (158, 8)])
def test_a_label_stays_inside_the_drawing(tmp_path: Path, place: tuple[int, int]) -> None:
    write_drawn(tmp_path / "drawn.png", canvas(), [Block(7, *place, 30, 30, 0, 255, 9)])
    image = stored_picture(tmp_path / "drawn.png")
    assert image.shape == (624, 948, 3)
    assert ((image == 0).all(axis=2)).sum() > 1500  # the whole ground of the label


@pytest.mark.parametrize(
    ("width", "height", "bars"),
    [
        (640, 480, (0, 19)),
        (480, 640, (0, 80)),
        (1280, 720, (15, 0)),
        (632, 416, (0, 0)),
        (158, 104, (0, 0)),
        (3, 400, (0, 157)),
        (4000, 2, (103, 0)),
    ],
)
def test_a_picture_of_another_shape_keeps_it(width: int, height: int, bars: tuple[int, int]) -> None:
    image = scaled(np.full((height, width, 3), 200, np.uint8))
    assert image.shape == (208, 316, 3)
    lit = np.all(image > 0, axis=2)
    rows, columns = np.flatnonzero(lit.any(axis=1)), np.flatnonzero(lit.any(axis=0))
    assert rows[0] == pytest.approx(bars[0], abs=1)
    assert columns[0] == pytest.approx(bars[1], abs=1)
    assert lit[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].all()


def test_a_circle_stays_a_circle() -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    cv2.circle(image, (320, 240), 150, (255, 255, 255), -1)
    lit = scaled(image)[:, :, 0] > 127
    assert np.ptp(np.flatnonzero(lit.any(axis=0))) == pytest.approx(np.ptp(np.flatnonzero(lit.any(axis=1))), abs=1)
