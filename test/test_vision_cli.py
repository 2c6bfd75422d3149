"""The verbs teach and detect on image files."""

import argparse
import json

import cv2
import numpy as np
import pytest
from vision_helpers import DATA, EXAMPLES, GROUPS, PARAMETERS, canvas, picture

from robot_formation.cli import detect, teach
from robot_formation.errors import FormationError
from robot_formation.parameters import to_mapping
from robot_formation.vision.signatures import load_signatures, save_signatures


def formation(*words):
    parser = argparse.ArgumentParser()
    subparsers = parser.add_subparsers()
    for verb in (teach, detect):
        verb.add_parser(subparsers)
    args = parser.parse_args([str(word) for word in words])
    return args.run(args)


def write_png(path, image):
    cv2.imwrite(str(path), image[:, :, ::-1])
    return path


@pytest.fixture
def files(tmp_path):
    """Signatures, parameters and the pictures of one single example and one sequence, as files."""
    save_signatures(tmp_path / "signatures.yaml", GROUPS["G1"])
    (tmp_path / "paper.json").write_text(json.dumps(to_mapping(PARAMETERS["paper"])))
    return tmp_path


def test_teach_prints_the_stored_bounds_and_keeps_the_other_signatures(files, capsys):
    example = next(e for e in EXAMPLES["teach"] if e["group"] == "G2" and e["kind"] == "region")
    out = files / "signatures.yaml"
    region = ",".join(map(str, example["region"]))
    assert formation("teach", DATA / example["image"], "--region", region, "--out", out, "--json") == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == {"signatures": [example["result"]]}
    assert printed.err == ""
    stored = load_signatures(out)
    assert stored[0].to_mapping() == example["result"]
    assert stored[1:] == GROUPS["G1"][1:]


def test_teach_from_a_point_uses_the_teach_threshold(files, capsys):
    example = next(e for e in EXAMPLES["teach"] if e["kind"] == "point" and e["grow_dist"] == 5600)
    point = ",".join(map(str, example["point"]))
    words = ("teach", DATA / example["image"], "--point", point, "--signature", example["sig"])
    assert formation(*words, "--parameters", files / "paper.json", "--json") == 0
    assert json.loads(capsys.readouterr().out)["signatures"] == [example["result"]]


def test_teach_refuses_a_file_that_holds_no_signatures(files):
    other = files / "notes.yaml"
    other.write_text("shopping: [milk]\n")
    with pytest.raises(FormationError, match="holds no signatures"):
        formation("teach", write_png(files / "red.png", canvas()), "--region", "0,0,9,9", "--out", other)
    assert other.read_text() == "shopping: [milk]\n"


def test_detect_answers_single_pictures_in_the_order_given(files, capsys):
    examples = [e for e in EXAMPLES["images"] if e["group"] == "G1"][::-1]
    paths = [write_png(files / f"{n}.png", picture(e["image"])) for n, e in enumerate(examples)]
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json", "--json")
    assert formation("detect", *paths, *words) == 0
    expected = [
        {"image": str(path), "blocks": example["expected"]["paper"]}
        for path, example in zip(paths, examples, strict=True)
    ]
    assert json.loads(capsys.readouterr().out) == expected


def test_detect_tracks_a_sequence(files, capsys):
    frames = EXAMPLES["sequences"][0]["frames"][:23]
    paths = [write_png(files / f"{n}.png", picture(frame["image"])) for n, frame in enumerate(frames)]
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json", "--json")
    assert formation("detect", *paths, *words, "--sequence", "--dt-us", 33_333) == 0
    answered = [result["blocks"] for result in json.loads(capsys.readouterr().out)]
    assert answered == [frame["expected"] for frame in frames]


def test_detect_prints_lines_and_draws(files, capsys):
    path = write_png(files / "some.png", picture("seqA_20.webp"))
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json")
    assert formation("detect", path, *words, "--draw", files / "drawn") == 0
    assert "some.png: 3 blocks\n  signature 3  x 114" in capsys.readouterr().out
    assert cv2.imread(str(files / "drawn" / "0001_some.png")).shape == (624, 948, 3)


def test_an_image_of_another_size_is_scaled_and_that_is_said(files, capsys):
    path = write_png(files / "large.png", np.repeat(np.repeat(picture("seqA_20.webp"), 2, axis=0), 2, axis=1))
    words = ("--signatures", files / "signatures.yaml", "--parameters", files / "paper.json", "--json")
    assert formation("detect", path, *words) == 0
    printed = capsys.readouterr()
    assert len(json.loads(printed.out)[0]["blocks"]) == 3
    assert "632 x 416 pixels, scaled to 316 x 208" in printed.err


@pytest.mark.parametrize(
    ("content", "message"), [(None, "can't be read"), (b"", "no image"), (b"\x89PNG\r\n\x1a\nxx", "no image")]
)
def test_a_missing_or_broken_image_is_refused_in_one_line(files, content, message):
    path = files / "broken.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FormationError, match=message) as error:
        formation("detect", path, "--signatures", files / "signatures.yaml")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1, 2]", "holds no parameters"),
        ("1: 2", "holds no parameters"),
        ("speed: 3", "no parameter 'speed'"),
        ("min_block_area: 1", "outside"),
        ("a: [", "neither YAML nor JSON"),
    ],
)
def test_wrong_parameters_are_refused(files, text, message):
    (files / "bad.yaml").write_text(text)
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
        ("detect", "a.png"),
        ("detect", "a.png", "--signatures", "s.yaml", "--sequence", "--dt-us", "0"),
    ],
)
def test_wrong_usage_ends_with_exit_code_2(words, capsys):
    with pytest.raises(SystemExit) as ended:
        formation(*words)
    assert ended.value.code == 2
