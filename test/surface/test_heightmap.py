import math
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from robot_formation.parameters import ParameterError
from robot_formation.surface import PLATE_SIZE_M, Surface, make_surface

TICKS = np.linspace(0.0, PLATE_SIZE_M, 19)
XS, YS = TICKS[None, :], TICKS[:, None]


def npy(tmp_path: Path, grid: npt.ArrayLike) -> str:
    file = tmp_path / "map.npy"
    np.save(file, grid)
    return str(file)


def png(tmp_path: Path, grid: npt.NDArray[np.uint16]) -> str:
    file = tmp_path / "map.png"
    assert cv2.imwrite(str(file), grid)
    return str(file)


def rough(tmp_path: Path, samples: int = 9, seed: int = 4) -> tuple[npt.NDArray[np.float64], Surface]:
    values = np.random.default_rng(seed).uniform(0.0, 0.1, (samples, samples))
    return values, make_surface("heightmap", {"file": npy(tmp_path, values), "scale_m": 1.0, "base_m": 0.0})


@pytest.mark.parametrize("name", ["bowl", "elliptic_bowl", "saddle", "inclined_plane"])
def test_samples_of_a_quadratic_surface_give_that_surface_exactly(tmp_path: Path, name: str) -> None:
    original = make_surface(name)
    file = npy(tmp_path, original.heights(XS, YS))
    copy = make_surface("heightmap", {"file": file, "scale_m": 1.0, "base_m": 0.0})
    for x in np.linspace(0.0, PLATE_SIZE_M, 23).tolist():
        for y in np.linspace(0.0, PLATE_SIZE_M, 29).tolist():
            assert copy.height(x, y) == pytest.approx(original.height(x, y), abs=1e-12)
            assert copy.gradient(x, y) == pytest.approx(original.gradient(x, y), abs=1e-11)


def test_a_wavy_surface_is_met_closely(tmp_path: Path) -> None:
    original = make_surface("ripple", {"direction_deg": 30.0})
    ticks = np.linspace(0.0, PLATE_SIZE_M, 90)
    file = npy(tmp_path, original.heights(ticks[None, :], ticks[:, None]))
    copy = make_surface("heightmap", {"file": file, "scale_m": 1.0, "base_m": 0.0})
    places = [(0.31, 1.27), (0.8, 0.8), (1.5, 0.2)]
    for x, y in places:
        assert copy.height(x, y) == pytest.approx(original.height(x, y), abs=1e-5)
        assert copy.gradient(x, y) == pytest.approx(original.gradient(x, y), abs=1e-3)


def test_the_ground_goes_through_the_samples(tmp_path: Path) -> None:
    values, surface = rough(tmp_path)
    ticks = np.linspace(0.0, PLATE_SIZE_M, 9).tolist()
    found = [[surface.height(x, y) for x in ticks] for y in ticks]
    assert np.array(found) == pytest.approx(values, abs=1e-12)


def test_height_and_gradient_have_no_jump_between_cells(tmp_path: Path) -> None:
    _, surface = rough(tmp_path)
    step = 1e-9
    for border in np.linspace(0.0, PLATE_SIZE_M, 9).tolist():
        for along in (-0.2, 0.1, 0.57, 1.1, PLATE_SIZE_M, 1.9):
            for before, after in (
                ((border - step, along), (border + step, along)),
                ((along, border - step), (along, border + step)),
            ):
                assert surface.height(*before) == pytest.approx(surface.height(*after), abs=1e-8)
                assert surface.gradient(*before) == pytest.approx(surface.gradient(*after), abs=1e-6)


def test_beyond_the_edge_the_ground_goes_straight_on(tmp_path: Path) -> None:
    _, surface = rough(tmp_path)
    slope_x, _ = surface.gradient(PLATE_SIZE_M, 0.7)
    assert surface.gradient(2.5, 0.7)[0] == pytest.approx(slope_x)
    assert surface.height(2.5, 0.7) == pytest.approx(surface.height(PLATE_SIZE_M, 0.7) + (2.5 - PLATE_SIZE_M) * slope_x)


def test_a_png_is_a_picture_from_above_and_an_array_begins_at_the_origin(tmp_path: Path) -> None:
    grid = np.zeros((5, 5), np.uint16)
    grid[0, 4] = 65535
    picture = make_surface("heightmap", {"file": png(tmp_path, grid), "scale_m": 0.2, "base_m": 0.1})
    assert picture.height(PLATE_SIZE_M, PLATE_SIZE_M) == pytest.approx(0.3)
    assert picture.height(0.0, 0.0) == pytest.approx(0.1)
    array = make_surface("heightmap", {"file": npy(tmp_path, grid), "scale_m": 0.2, "base_m": 0.1})
    assert array.height(PLATE_SIZE_M, 0.0) == pytest.approx(0.3)


def test_without_a_file_it_is_the_example() -> None:
    surface = make_surface("heightmap")
    heights = surface.heights(XS, YS)
    assert 0.04 < heights.min() < heights.max() < 0.2
    assert np.ptp(heights) > 0.05


def cut_off(tmp_path: Path) -> str:
    file = tmp_path / "cut.npy"
    np.save(tmp_path / "whole.npy", np.zeros((8, 8)))
    file.write_bytes((tmp_path / "whole.npy").read_bytes()[:300])
    return str(file)


def cut_off_png(share: float) -> Callable[[Path], str]:
    def make(tmp_path: Path) -> str:
        noise = np.random.default_rng(1).integers(0, 65536, (80, 80), np.uint16)
        content = Path(png(tmp_path, noise)).read_bytes()
        file = tmp_path / "cut.png"
        file.write_bytes(content[: int(share * len(content))])
        return str(file)

    return make


def claims_to_be_huge(tmp_path: Path) -> str:
    file = tmp_path / "huge.png"
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBB", 13, b"IHDR", 60000, 60000, 16, 0, 0, 0, 0))
    return str(file)


def written(name: str, content: bytes) -> Callable[[Path], str]:
    def make(tmp_path: Path) -> str:
        (tmp_path / name).write_bytes(content)
        return str(tmp_path / name)

    return make


def archive(tmp_path: Path) -> str:
    np.savez(tmp_path / "map.npz", np.zeros((8, 8)))
    return str(tmp_path / "map.npz")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: str(path / "missing.npy"), "missing.npy: can't read it: No such file"),
        (lambda path: str(path), "can't read it: Is a directory"),
        (written("map.npy", b""), "neither a PNG nor a usable NPY"),
        (written("map.txt", b"1 2 3"), "neither a PNG nor a usable NPY"),
        (written("map.png", b"\x89PNG\r\n\x1a\n12"), "cut off"),
        (cut_off, "neither a PNG nor a usable NPY"),
        (cut_off_png(0.01), "damaged"),
        (cut_off_png(0.6), "damaged"),
        (claims_to_be_huge, "60000 x 60000 samples; give 4 to 4096"),
        (archive, "NPZ archive"),
        (lambda path: npy(path, np.zeros((8, 9))), "the grid of 8 x 9 is not"),
        (lambda path: npy(path, np.zeros((8, 8, 3))), "the grid of 8 x 8 x 3 is not"),
        (lambda path: npy(path, np.float64(1.0)), "the grid of one number is not"),
        (lambda path: npy(path, np.zeros((3, 3))), "3 x 3 samples"),
        (lambda path: npy(path, np.zeros((4097, 4097), np.uint16)), "4097 x 4097 samples"),
        (lambda path: npy(path, np.zeros((8, 8), np.int32)), "holds int32 numbers"),
        (lambda path: npy(path, np.zeros((8, 8), complex)), "holds complex128 numbers"),
        (lambda path: npy(path, np.array([[{}] * 8] * 8)), "holds object numbers"),
        (lambda path: npy(path, np.full((8, 8), math.nan)), "not finite"),
        (lambda path: npy(path, np.full((8, 8), math.inf)), "not finite"),
        (lambda path: npy(path, np.full((8, 8), 1e300)), "choose scale_m"),
        (lambda path: png(path, np.zeros((8, 8), np.uint8)), "8 bits and colour type 0; save it as 16-bit"),
        (lambda path: png(path, np.zeros((8, 8, 3), np.uint16)), "16 bits and colour type 2; save it as 16-bit"),
        (lambda path: png(path, np.zeros((8, 9), np.uint16)), "the grid of 8 x 9 is not"),
    ],
)
def test_a_bad_file_is_refused_with_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], make: Callable[[Path], str], says: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        make_surface("heightmap", {"file": make(tmp_path)})
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""
