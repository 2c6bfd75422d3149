"""Tags: found where they are on drawn and on rendered pictures, and nowhere else."""

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.surface import Surface, make_surface
from robot_formation.vision import aruco_patterns
from robot_formation.vision.aruco_detector import TagDetector
from robot_formation.vision.aruco_patterns import MODULES, QUIET_MODULES, TagError, pattern
from robot_formation.vision.marker import Face, MarkerKind
from robot_formation.vision.pixy2.block_tracking import ClockError
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import PictureError
from robot_formation.vision.tag_parameters import TagParameters
from robot_formation.world.camera import Camera
from robot_formation.world.parameters import MarkerParameters, WorldParameters
from robot_formation.world.pose import pose_on_surface
from robot_formation.world.sensor import Sensor
from tag_helpers import missing

if missing():
    pytest.skip(missing(), allow_module_level=True)

WORLD = WorldParameters(marker=MarkerParameters(kind=MarkerKind.TAGS))
PLANE, BOWL = make_surface("plane"), make_surface("bowl")
GREY = np.full((208, 316, 3), 110, np.uint8)
DETECTOR = TagDetector()
HALF, MIDDLE_Z = 0.03, 0.186
# Corners of each face as its looker sees them, from the top left.
CORNERS = {
    Face.TARGET: [(-HALF, -HALF), (HALF, -HALF)],
    Face.FRONT: [(HALF, -HALF), (HALF, HALF)],
    Face.REAR: [(-HALF, HALF), (-HALF, -HALF)],
}


def drawn(
    face: Face,
    corners: Sequence[tuple[int, int]] | npt.NDArray[np.float64] | npt.NDArray[np.int64],
    background: npt.NDArray[np.uint8] = GREY,
    light: int = 210,
    dark: int = 20,
) -> npt.NDArray[np.uint8]:
    """A tag of known outline (4, 2), drawn by warping it, eight samples per pixel and way."""
    modules = np.pad(pattern(face), QUIET_MODULES, constant_values=True)
    texture = np.kron(np.where(modules, light, dark), np.ones((32, 32))).astype(np.uint8)
    size = np.float32(len(texture))
    # Texture coordinates run from edge to edge; picture coordinates are pixel centres.
    source = np.array([(0, 0), (size, 0), (size, size), (0, size)], np.float32) - np.float32(0.5)
    target = (np.array(corners, np.float32) + np.float32(0.5)) * 8 - np.float32(0.5)
    projection = cv2.getPerspectiveTransform(source, target)
    large = cv2.resize(background[..., 0], None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    canvas_size = (large.shape[1], large.shape[0])
    inside = cv2.warpPerspective(np.full_like(texture, 255), projection, canvas_size)
    large = np.where(inside > 127, cv2.warpPerspective(texture, projection, canvas_size), large)
    return np.repeat(cv2.resize(large, (316, 208), interpolation=cv2.INTER_AREA)[..., None], 3, axis=2)


def rendered(
    ahead_m: float, aside_m: float, yaw_rad: float, surface: Surface = PLANE, seed: int = 0
) -> tuple[npt.NDArray[np.uint8], dict[Face, npt.NDArray[np.float64]]]:
    """A picture of a neighbour so far ahead and to the left, turned so far, and its faces' true outlines."""
    camera = Camera(surface, WORLD)
    looking = pose_on_surface(surface, 0.89, 0.5, 0.0)
    seen = pose_on_surface(surface, 0.89 + ahead_m, 0.5 + aside_m, yaw_rad)
    sensor = Sensor(WORLD.camera, seed, "test")
    picture = sensor.expose(sensor.develop(camera.light(looking, [seen])), 0.0)
    outlines = {}
    for face, ((x0, y0), (x1, y1)) in CORNERS.items():
        places = [
            (x, y, MIDDLE_Z + z) for x, y, z in ((x0, y0, HALF), (x1, y1, HALF), (x1, y1, -HALF), (x0, y0, -HALF))
        ]
        outlines[face] = camera.project(looking, np.array(places) @ seen.matrix().T + np.array(seen.position))
    return picture, outlines


def one(detector: TagDetector, picture: npt.NDArray[np.uint8]) -> tuple[Face, npt.NDArray[np.float32]]:
    ((face, corners),) = detector.faces(picture)
    return face, corners


@pytest.mark.parametrize("face", Face)
@pytest.mark.parametrize("side", [22, 50, 90])
def test_a_drawn_tag_is_found_with_its_corners_in_order(face: Face, side: int) -> None:
    truth = np.array([(100.3, 60.6), (100.3 + side, 60.6), (100.3 + side, 60.6 + side), (100.3, 60.6 + side)])
    found, corners = one(DETECTOR, drawn(face, truth))
    assert found == face
    # A drawn edge without noise falls on the same fraction of a pixel everywhere: the detector's worst case.
    np.testing.assert_allclose(corners, truth, atol=1.5)


@settings(max_examples=40, deadline=None)
@given(
    side=st.floats(34, 80),
    squeeze=st.floats(0.6, 1.0),
    slant=st.floats(-0.12, 0.12),
    left=st.floats(4, 200),
    top=st.floats(12, 100),
    face=st.sampled_from(list(Face)),
)
def test_a_tag_seen_obliquely_is_reported_as_its_bounding_box(
    side: float, squeeze: float, slant: float, left: float, top: float, face: Face
) -> None:
    right, shear = left + squeeze * side, slant * side
    truth = np.array([(left, top), (right, top + shear), (right, top + side - shear), (left, top + side)])
    (box,) = DETECTOR.detect(drawn(face, truth))
    assert box.signature == face
    reported = (box.x - box.width / 2, box.x + box.width / 2, box.y - box.height / 2, box.y + box.height / 2)
    low, high = truth.min(axis=0), truth.max(axis=0)
    # Whole pixels take up to 0.75 px at an edge, the detector's own error the rest.
    assert reported == pytest.approx((low[0], high[0], low[1], high[1]), abs=2.3)


@pytest.mark.parametrize("surface", [PLANE, BOWL], ids=["plane", "bowl"])
@pytest.mark.parametrize(
    ("ahead", "aside", "yaw"),
    [(0.0, 0.26, 0.0), (0.0, 0.32, 0.0), (0.05, 0.4, 0.4), (-0.1, 0.5, -0.5), (0.0, 0.6, 0.2)],
)
def test_the_target_face_is_found_where_a_pinhole_puts_its_corners(
    surface: Surface, ahead: float, aside: float, yaw: float
) -> None:
    picture, outlines = rendered(ahead, aside, yaw, surface)
    found = dict(DETECTOR.faces(picture))
    np.testing.assert_allclose(found[Face.TARGET], outlines[Face.TARGET], atol=1.2)


@pytest.mark.parametrize(("yaw", "beside"), [(-0.8, Face.FRONT), (0.8, Face.REAR)])
def test_two_faces_in_view_are_two_blocks(yaw: float, beside: Face) -> None:
    picture, outlines = rendered(0.0, 0.35, yaw)
    found = dict(DETECTOR.faces(picture))
    assert set(found) == {Face.TARGET, beside}
    np.testing.assert_allclose(found[beside], outlines[beside], atol=1.5)


def test_edges_have_no_bias_worth_correcting() -> None:
    errors = []
    for number in range(24):
        picture, outlines = rendered(
            0.004 * (number % 5 - 2), 0.28 + 0.01 * number, 0.05 * (number % 7 - 3), seed=number
        )
        corners, truth = dict(DETECTOR.faces(picture))[Face.TARGET], outlines[Face.TARGET]
        errors.append([f(corners[:, i]) - f(truth[:, i]) for i in (0, 1) for f in (np.min, np.max)])
    assert np.abs(np.mean(errors, axis=0)) == pytest.approx(np.zeros(4), abs=0.25)
    assert np.std(errors, axis=0) == pytest.approx(np.zeros(4), abs=0.5)


@pytest.mark.parametrize("aside", np.linspace(0.26, 0.6, 8))
def test_a_face_that_is_turned_by_up_to_45_degrees_is_found_in_every_picture(aside: float) -> None:
    for number, yaw in enumerate(np.radians([-45, -25, 0, 25, 45])):
        picture, _ = rendered(0.0, aside, float(yaw), seed=number)
        assert Face.TARGET in dict(DETECTOR.faces(picture))


def noise(number: int) -> npt.NDArray[np.uint8]:
    """Noise of grains from one pixel up."""
    grain = 1 + number % 6
    grains = np.random.default_rng(number).integers(0, 256, (208 // grain + 1, 316 // grain + 1, 3), dtype=np.uint8)
    return np.kron(grains, np.ones((grain, grain, 1), np.uint8))[:208, :316]


def test_there_is_nothing_in_black_white_grey_and_noise() -> None:
    for picture in (np.zeros_like(GREY), np.full_like(GREY, 255), GREY, *map(noise, range(24))):
        assert DETECTOR.detect(picture) == []


def test_there_is_nothing_on_a_marker_of_colours() -> None:
    plain = Camera(PLANE, WorldParameters())
    looking, seen = pose_on_surface(PLANE, 0.89, 0.5, 0.0), pose_on_surface(PLANE, 0.89, 0.82, 0.6)
    sensor = Sensor(WORLD.camera, 0, "test")
    assert DETECTOR.detect(sensor.expose(sensor.develop(plain.light(looking, [seen])), 0.0)) == []


@pytest.mark.parametrize("hidden", ["left", "right", "top", "bottom"])
def test_a_tag_whose_dark_square_is_partly_covered_is_not_found(hidden: str) -> None:
    picture = drawn(Face.TARGET, [(100, 60), (150, 60), (150, 110), (100, 110)])
    rows, columns = {
        "left": (slice(None), slice(0, 112)),
        "right": (slice(None), slice(138, None)),
        "top": (slice(0, 72), slice(None)),
        "bottom": (slice(98, None), slice(None)),
    }[hidden]
    picture[rows, columns] = 110
    assert DETECTOR.detect(picture) == []


def test_other_tags_of_the_dictionary_are_left_alone() -> None:
    corners = np.array([(100, 60), (150, 60), (150, 110), (100, 110)])
    assert one(DETECTOR, drawn(Face.TARGET, corners))[0] is Face.TARGET
    other = cv2.aruco.generateImageMarker(aruco_patterns.dictionary(), 17, MODULES * 7)
    picture = GREY.copy()
    picture[50:120, 90:160] = 210
    picture[60 : 60 + len(other), 100 : 100 + len(other)] = other[..., None]
    assert DETECTOR.detect(picture) == []


@pytest.mark.parametrize("bad", [None, [[0]], GREY[..., 0], GREY[:-1], GREY.astype(float), GREY[:, ::2]])
def test_a_picture_of_another_shape_or_type_is_refused(bad: list[list[int]] | npt.NDArray[np.uint8] | None) -> None:
    with pytest.raises(PictureError):
        DETECTOR.process(bad, 0)  # type: ignore[arg-type]  # what callers must not do


def test_tags_are_tracked_as_blocks_of_a_colour_are() -> None:
    detector = TagDetector(tracking=DetectorParameters(block_filtering=40))
    picture = drawn(Face.FRONT, [(100, 60), (150, 60), (150, 110), (100, 110)])
    reports = [detector.process(picture, 33_333 * number) for number in range(24)]
    assert [bool(blocks) for blocks in reports] == [False] * 20 + [True] * 4
    assert [blocks[0].age for blocks in reports[20:]] == [0, 1, 2, 3]
    kept = [detector.process(GREY, 33_333 * number) for number in range(24, 40)]
    assert [bool(blocks) for blocks in kept].index(False) == 10
    with pytest.raises(ClockError):
        detector.process(GREY, 0)
    detector.reset()
    assert detector.process(picture, 0) == []


@pytest.mark.parametrize("enlargement", [1, 2, 3, 4])
def test_an_enlarged_search_reports_places_in_the_cameras_pixels(enlargement: int) -> None:
    truth = np.array([(120.0, 40.0), (170.0, 40.0), (170.0, 90.0), (120.0, 90.0)])
    detector = TagDetector(TagParameters(enlargement=enlargement))
    np.testing.assert_allclose(one(detector, drawn(Face.REAR, truth))[1], truth, atol=0.8)


def test_tags_smaller_than_the_shortest_outline_are_not_looked_at() -> None:
    picture = drawn(Face.TARGET, [(100, 60), (150, 60), (150, 110), (100, 110)])
    dark = 4 * 50 * MODULES / (MODULES + 2 * QUIET_MODULES)
    assert TagDetector(TagParameters(min_perimeter_px=0.8 * dark)).detect(picture)
    assert not TagDetector(TagParameters(min_perimeter_px=1.2 * dark)).detect(picture)


def test_the_three_patterns_differ_in_many_modules_whichever_way_they_are_turned() -> None:
    for face in Face:
        for other in Face:
            for quarter in range(4):
                if (face, 0) != (other, quarter):
                    assert np.count_nonzero(pattern(face) != np.rot90(pattern(other), quarter)) >= 6


def test_a_dark_border_surrounds_every_pattern() -> None:
    for face in Face:
        assert not np.delete(pattern(face), range(1, MODULES - 1), axis=0).any()
        assert not np.delete(pattern(face), range(1, MODULES - 1), axis=1).any()


def test_an_opencv_without_the_detector_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(cv2.aruco, "ArucoDetector")
    with pytest.raises(TagError, match=r"OpenCV 4\.7 or newer") as caught:
        TagDetector()
    assert "\n" not in str(caught.value)


def test_a_view_at_30_degrees_shows_a_face_narrower_not_lower() -> None:
    picture, _ = rendered(0.0, 0.45, math.radians(30))
    box = next(box for box in DETECTOR.detect(picture) if box.signature == Face.TARGET)
    assert box.width < 0.95 * box.height
