"""What PNG, height-map, picture and log files say of themselves is checked before they are decoded."""

import io
import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from robot_formation.analysis.displacement_log import read_log
from robot_formation.analysis.errors import AnalysisError
from robot_formation.parameters import ParameterError
from robot_formation.surface.height_file import read_heights
from robot_formation.system.png_files import is_whole, png_head, unpacks_within
from robot_formation.vision.pixy2.picture import PictureError
from robot_formation.vision.pixy2.picture_files import read_picture


def png(width: int, height: int, depth: int, colour: int, data: bytes) -> bytes:
    """A PNG file of these numbers and pixels, which need not fit."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


GOOD = png(8, 8, 16, 0, (b"\0" + bytes(range(16))) * 8)


def silent(text: str) -> None:
    """Take no notice of warnings."""


def test_a_png_file_tells_its_size_and_whether_it_is_whole() -> None:
    assert png_head(GOOD) == (8, 8, 16, 0)
    assert is_whole(GOOD)
    assert not is_whole(GOOD[:-1])
    assert not is_whole(GOOD[:45] + b"x" + GOOD[46:])
    assert png_head(GOOD[:20]) is None
    assert png_head(b"BM" + GOOD) is None
    head = png_head(GOOD)
    assert head is not None
    assert unpacks_within(GOOD, head.data_bytes)
    assert unpacks_within(GOOD, 136)
    assert not unpacks_within(GOOD, 135)


@pytest.mark.parametrize(("depth", "colour"), [(8, 2), (16, 0), (1, 0), (8, 6), (8, 3)])
def test_the_bound_of_a_pngs_pixels_holds_for_real_ones_interlaced_too(depth: int, colour: int) -> None:
    # Adam7's passes of a 9 x 7 picture, each row with a byte of its filter.
    samples = {0: 1, 2: 3, 3: 1, 6: 4}[colour]
    passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    total = 0
    for x, y, step_x, step_y in passes:
        columns, rows = len(range(x, 900, step_x)), len(range(y, 700, step_y))
        total += rows * ((columns * depth * samples + 7) // 8 + 1) if columns else 0
    head = png_head(png(900, 700, depth, colour, b""))
    assert head is not None
    assert head.data_bytes >= total


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.png", png(8, 8, 16, 0, bytes(10**7)), "damaged"),
        ("a.png", png(30_000, 30_000, 16, 0, b""), "30000 x 30000 samples"),
        ("a.npy", b"\x93NUMPY\x01\x00", "neither a PNG nor a usable NPY file"),
        ("a.npy", b"\x93NUMPY\x01\x00\x10\x00{'descr': '<f8',", "neither a PNG nor a usable NPY file"),
        ("a.npy", b"\x93NUMPY\x01\x00\x05\x00(((((", "neither a PNG nor a usable NPY file"),
        ("a.npy", b"\x93NUMPY\x02\x00\x05\x00\x00\x00\xff\xfe\xfd\xfc\xfb", "neither a PNG nor a usable NPY file"),
        ("a.npy", b"PK\x03\x04", "NPZ archive"),
        ("a.npy", b"", "neither a PNG nor a usable NPY file"),
    ],
)
def test_height_maps_are_refused_before_they_are_decoded(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ParameterError, match=said):
        read_heights(path)


def test_every_cut_of_a_height_map_is_refused_in_one_line(tmp_path: Path) -> None:
    stream = io.BytesIO()
    np.save(stream, np.ones((4, 4)))
    for content in (stream.getvalue(), GOOD):
        for cut in range(len(content)):
            path = tmp_path / "heights"
            path.write_bytes(content[:cut])
            with pytest.raises(ParameterError) as raised:
                read_heights(path)
            assert "\n" not in str(raised.value)


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_height_maps_of_all_versions_of_npy_are_read(tmp_path: Path, version: tuple[int, int]) -> None:
    values = np.arange(16.0).reshape(4, 4)
    with (tmp_path / "heights.npy").open("wb") as file:
        np.lib.format.write_array(file, values, version)
    assert np.array_equal(read_heights(tmp_path / "heights.npy"), values)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (png(30_000, 30_000, 8, 2, b""), "more than 50,000,000 pixels"),
        (png(2**31 - 1, 2**31 - 1, 8, 2, b""), "more than 50,000,000 pixels"),
        (png(316, 208, 8, 2, bytes(10**7)), "no image that can be read"),
        (b"P6\n100000 100000\n255\n", "more than 50,000,000 pixels"),
        (b"\xff\xd8" + bytes(10**7), "no image that can be read"),
        (b"", "no image that can be read"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "no image that can be read"),
    ],
)
def test_pictures_are_refused_before_they_are_decoded(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(content)
    with pytest.raises(PictureError, match=said):
        read_picture(path, silent)


def test_pipes_and_devices_are_no_pictures_height_maps_or_logs(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, said in ((tmp_path / "pipe", "Is a named pipe"), (Path("/dev/zero"), "Is a device")):
        with pytest.raises(PictureError, match=said):
            read_picture(path, silent)
        with pytest.raises(ParameterError, match=said):
            read_heights(path)
        with pytest.raises(AnalysisError, match=said):
            read_log(path)


def test_logs_are_bounded_in_rows_and_in_the_length_of_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "log.csv"
    path.write_text("u_m,v_m\n" + "0.0,0.05\n" * 20)
    assert len(read_log(path)) == 20
    monkeypatch.setattr("robot_formation.analysis.displacement_log._MOST_ROWS", 19)
    with pytest.raises(AnalysisError, match="line 21: a log holds up to 19 timesteps"):
        read_log(path)
    path.write_text("u_m,v_m\n" + "0.0," * 10_000 + "\n")
    with pytest.raises(AnalysisError, match="line 2: has more than 20000 characters"):
        read_log(path)
