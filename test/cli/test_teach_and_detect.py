"""The verbs teach and detect on image files."""

import argparse
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from robot_formation.cli import detect, teach
from robot_formation.errors import FormationError
from robot_formation.parameters import specs, to_mapping
from robot_formation.vision.marker import MarkerKind
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture_files import CAMERA_PARAMETERS, read_parameters
from robot_formation.vision.pixy2.signatures import load_signatures, save_signatures
from robot_formation.world.marker_picture import marker_picture
from robot_formation.world.parameters import CameraParameters, MarkerParameters, WorldParameters
from tag_helpers import needs_tags
from vision_helpers import DATA, EXAMPLES, GROUPS, PARAMETERS, canvas, picture


def formation(*words: object) -> int:
    parser = argparse.ArgumentParser()
    subparsers = parser.add_subparsers()
    for verb in (teach, detect):
        verb.add_parser(subparsers)
    args = parser.parse_args([str(word) for word in words])
    code: int = args.run(args)
    return code


def write_png(path: Path, image: NDArray[np.uint8]) -> Path:
    cv2.imwrite(str(path), image[:, :, ::-1])
    return path


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Signatures, parameters and the pictures of one single example and one sequence, as files."""
    save_signatures(tmp_path / "signatures.yaml", GROUPS["G1"])
    (tmp_path / "paper.json").write_text(json.dumps(to_mapping(PARAMETERS["paper"])))
    return tmp_path


def test_teach_prints_the_stored_bounds_and_keeps_the_other_signatures(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example = next(e for e in EXAMPLES["teach"] if e["group"] == "G2" and e["kind"] == "region")
    out = files / "signatures.yaml"
    region = ",".join(map(str, example["region"]))
    assert formation("teach", DATA / example["image"], "--region", region, "--out", out, "--json") == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == {"signatures": [example["result"]], "warnings": []}
    assert printed.err == ""
    stored = load_signatures(out)
    assert stored[0].to_mapping() == example["result"]
    assert stored[1:] == GROUPS["G1"][1:]


def test_teach_from_a_point_uses_the_teach_threshold(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example = next(e for e in EXAMPLES["teach"] if e["kind"] == "point" and e["grow_dist"] == 5600)
    point = ",".join(map(str, example["point"]))
    words = ("teach", DATA / example["image"], "--point", point, "--signature", example["sig"])
    assert formation(*words, "--parameters", files / "paper.json", "--json") == 0
    assert json.loads(capsys.readouterr().out)["signatures"] == [example["result"]]


def test_teach_refuses_a_file_that_holds_no_signatures(files: Path) -> None:
    other = files / "notes.yaml"
    other.write_text("shopping: [milk]\n")
    with pytest.raises(FormationError, match="holds no signatures"):
        formation("teach", write_png(files / "red.png", canvas()), "--region", "0,0,9,9", "--out", other)
    assert other.read_text() == "shopping: [milk]\n"


def test_detect_answers_single_pictures_in_the_order_given(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    examples = [e for e in EXAMPLES["images"] if e["group"] == "G1"][::-1]
    paths = [write_png(files / f"{n}.png", picture(e["image"])) for n, e in enumerate(examples)]
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json", "--json")
    assert formation("detect", *paths, *words) == 0
    expected = [
        {"image": str(path), "blocks": example["expected"]["paper"]}
        for path, example in zip(paths, examples, strict=True)
    ]
    assert json.loads(capsys.readouterr().out) == expected


def test_detect_tracks_a_sequence(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frames = EXAMPLES["sequences"][0]["frames"][:23]
    paths = [write_png(files / f"{n}.png", picture(frame["image"])) for n, frame in enumerate(frames)]
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json", "--json")
    assert formation("detect", *paths, *words, "--sequence", "--dt-us", 33_333) == 0
    answered = [result["blocks"] for result in json.loads(capsys.readouterr().out)]
    assert answered == [frame["expected"] for frame in frames]


def test_detect_prints_lines_and_draws(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_png(files / "some.png", picture("seqA_20.webp"))
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json")
    assert formation("detect", path, *words, "--draw", files / "drawn") == 0
    assert "some.png: 3 blocks\n  signature 3  x 114" in capsys.readouterr().out
    drawn = cv2.imread(str(files / "drawn" / "0001_some.png"))
    assert drawn is not None
    assert drawn.shape == (624, 948, 3)


def test_an_image_of_another_size_is_scaled_and_that_is_said(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_png(files / "large.png", np.repeat(np.repeat(picture("seqA_20.webp"), 2, axis=0), 2, axis=1))
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json", "--json")
    assert formation("detect", path, *words) == 0
    printed = capsys.readouterr()
    assert len(json.loads(printed.out)[0]["blocks"]) == 3
    assert "632 x 416 pixels, scaled to 316 x 208" in printed.err


@pytest.mark.parametrize(
    ("content", "message"), [(None, "can't be read"), (b"", "no image"), (b"\x89PNG\r\n\x1a\nxx", "no image")]
)
def test_a_missing_or_broken_image_is_refused_in_one_line(files: Path, content: bytes | None, message: str) -> None:
    path = files / "broken.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FormationError, match=message) as error:
        formation("detect", path, "--signatures", files / "signatures.yaml")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("extension", [".png", ".jpg", ".webp", ".bmp", ".tiff"])
def test_damaged_images_are_read_or_refused_with_a_line_of_ours_and_nothing_of_the_image_libraries(
    files: Path, capfd: pytest.CaptureFixture[str], extension: str
) -> None:
    encoded = cv2.imencode(extension, picture("seqA_20.webp"))[1].ravel()
    signatures = files / "signatures.yaml"
    refused, damaged = [], 0
    rng = np.random.default_rng(5)
    for share in np.linspace(0.05, 0.95, 10):
        content = encoded[: int(share * len(encoded))].copy() if share < 0.5 else encoded.copy()
        content[rng.integers(0, len(content), 8)] ^= 16
        path = files / f"damaged{extension}"
        path.write_bytes(content.tobytes())
        try:
            formation("detect", path, "--signatures", signatures, "--json")
        except FormationError as error:
            refused.append(str(error))
        lines = capfd.readouterr().err.splitlines()
        assert all(line.startswith(f"{path}: ") for line in lines)
        damaged += any("damaged, used as far as it can be read" in line for line in lines)
    assert all("\n" not in text for text in refused)
    assert refused or damaged or extension == ".bmp"  # which has nothing that could tell


PIXYMON = {
    "Signature 1 range": 5.0,
    "Signature 3 range": 6.0,
    "Min brightness": 0.15,
    "Camera brightness": 100,
    "Block filtering": 40,
    "Max merge dist": 4,
    "Min block area": 20,
    "Signature teach threshold": 5600,
    "LED brightness": 4960,
    "Max blocks": 50,
    "Max blocks per signature": 10,
    "Max tracking velocity": 80,
    "Color code mode": 2,
    "Auto Exposure Correction": 1,
    "Auto White Balance": 0,
    "Auto White Balance on power-up": 1,
    "Flicker avoidance": 0,
    "Min frames per second": 30,
}


def test_all_parameters_are_known_by_their_pixymon_names_and_those_of_the_camera_are_said_to_have_no_effect(
    tmp_path: Path,
) -> None:
    (tmp_path / "pixymon.json").write_text(json.dumps(PIXYMON))
    said: list[str] = []
    read = read_parameters(tmp_path / "pixymon.json", said.append)
    assert read == DetectorParameters(
        signature_range=(5.0, 3.5, 6.0, 3.5, 3.5, 3.5, 3.5),
        min_brightness=0.15,
        block_filtering=40,
        max_merge_dist=4,
        min_block_area=20,
        signature_teach_threshold=5600,
        max_blocks=50,
        max_blocks_per_signature=10,
        max_tracking_velocity=80,
        color_code_mode=2,
        led_brightness=4960,
    )
    (line,) = said
    assert all(name in line for name in CAMERA_PARAMETERS)
    assert "no effect on a picture that is taken already" in line


def test_the_cameras_parameters_are_those_of_the_worlds_camera() -> None:
    assert set(specs(CameraParameters)) >= CAMERA_PARAMETERS


def test_every_pixymon_name_begins_a_parameters_description() -> None:
    known = {**specs(DetectorParameters), **{name: specs(CameraParameters)[name] for name in CAMERA_PARAMETERS}}
    described = {spec.description.split(":")[0] for spec in known.values()}
    assert described == {"Signature 1 range to Signature 7 range", *PIXYMON} - {
        "Signature 1 range",
        "Signature 3 range",
    }


def test_one_file_of_parameters_serves_teach_and_detect(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (files / "pixymon.yaml").write_text(yaml.safe_dump(PIXYMON))
    words = ("--parameters", files / "pixymon.yaml", "--json")
    image = DATA / "G1_teach_region.webp"
    assert formation("teach", image, "--point", "158,104", *words) == 0
    assert formation("detect", image, "--signatures", files / "signatures.yaml", *words) == 0
    assert capsys.readouterr().err.count("camera_brightness") == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Signature 8 range: 1.0", "no parameter 'signature_8_range'"),
        ("Signature 1 range: wide", "must be of type float"),
        ("Signature 1 range: 30", "outside 0.0 to 25.0"),
        ("{Signature 1 range: 1, signature_range: [1]}", "either 'signature_range' or"),
        ("{Min brightness: 0.1, min_brightness: 0.2}", "'min_brightness' is given twice"),
        ("LED brightness: 20001", "outside 0 to 20000 uA"),
        ("'': 1", "no parameter ''"),
        ("min_block_area: &a {b: *a}", "inside what it refers to"),
        (f"min_block_area: 0x{'f' * 5000}", "larger than any number"),
        ("min_block_area: {a: 1}", "no parameter 'min_block_area.a'"),
        ("[1, 2]", "holds no parameters"),
        ("1: 2", "holds no parameters"),
        ("speed: 3", "no parameter 'speed'"),
        ("min_block_area: 1", "outside"),
        ("a: [", "no valid YAML"),
    ],
)
def test_wrong_parameters_are_refused(files: Path, text: str, message: str) -> None:
    (files / "bad.yaml").write_text(text)
    write_png(files / "any.png", canvas())
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "bad.yaml")
    with pytest.raises(FormationError, match=message):
        formation("detect", files / "any.png", *words)


@pytest.mark.parametrize(
    "words",
    [
        ("teach", "a.png"),
        ("teach", "a.png", "--region", "1,2,3"),
        ("teach", "a.png", "--point", "1,x"),
        ("teach", "a.png", "--point", "1,2", "--signature", "8"),
        ("detect", "a.png", "--sensor", "tag"),
        ("detect", "a.png", "--signatures", "s.yaml", "--sequence", "--dt-us", "0"),
    ],
)
def test_wrong_usage_ends_with_exit_code_2(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        formation(*words)
    assert ended.value.code == 2


@needs_tags
def test_detect_finds_the_faces_of_a_marker_of_tags_without_signatures(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = WorldParameters(marker=MarkerParameters(kind=MarkerKind.TAGS))
    images = [write_png(files / f"{face}.png", marker_picture(world, face)) for face in ("target", "front", "rear")]
    assert formation("detect", *images, "--sensor", "tags", "--json") == 0
    found = [entry["blocks"] for entry in json.loads(capsys.readouterr().out)]
    assert [[block["signature"] for block in blocks] for blocks in found] == [[1], [2], [3]]
    assert all(blocks[0]["width"] == pytest.approx(50, abs=2) for blocks in found)


def test_detect_asks_for_signatures_if_colours_are_looked_for(files: Path) -> None:
    with pytest.raises(FormationError, match="--signatures FILE"):
        formation("detect", write_png(files / "red.png", canvas()))
