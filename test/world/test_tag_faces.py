"""The marker of tags: drawn where it belongs, not mirrored, and without a trace in a world of colours."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from robot_formation.parameters import ParameterError, from_mapping
from robot_formation.surface import make_surface
from robot_formation.vision import aruco_patterns
from robot_formation.vision.aruco_patterns import MODULES, pattern
from robot_formation.vision.marker import Face
from robot_formation.world.camera import Camera
from robot_formation.world.description import robot_description
from robot_formation.world.marker_picture import marker_picture
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface
from robot_formation.world.scene import Scene
from robot_formation.world.tag_faces import FACES, tag_rectangles
from tag_helpers import needs_tags
from world_helpers import parameters

PLANE = make_surface("plane")
TAGS = {"marker": {"kind": "tags"}}


@needs_tags
@pytest.mark.parametrize(("face", "name"), [(Face.TARGET, "target"), (Face.FRONT, "front"), (Face.REAR, "rear")])
def test_each_face_shows_its_pattern_upright_and_not_mirrored(face: Face, name: str) -> None:
    # Seen from near by a camera of four times the resolution, module by module.
    sharp = {"width_px": 1264, "height_px": 832, "focal_length_px": 1094.8, "centre_x_px": 631.5, "centre_y_px": 415.5}
    picture = marker_picture(parameters(**TAGS, camera=sharp), name).mean(axis=2)
    edge = 4 * 50.07
    left, top = 631.5 - 0.5 * edge, 415.5 - 4 * 50.07 - 0.5 * edge
    centres = (np.arange(MODULES) + 1.5) * edge / (MODULES + 2)
    levels = picture[np.rint(top + centres).astype(int)][:, np.rint(left + centres).astype(int)]
    assert ((levels > levels.mean()) == pattern(face)).all()


@needs_tags
def test_the_tag_has_the_size_of_the_face_in_the_picture() -> None:
    light = Camera(PLANE, parameters(**TAGS)).light(
        pose_on_surface(PLANE, 0.9, 0.4, 0.0), [pose_on_surface(PLANE, 0.9, 0.72, 0.0)]
    )
    picture = light[..., 0] > 0.35 * light.max()
    # The light margin against the dark modules and the dark body's foot: 50 px of face, 39 px of dark square.
    row = picture[round(103.5 - 50.07)]
    dark = np.flatnonzero(~row[100:215]) + 100
    assert (dark[0], dark[-1]) == pytest.approx((157.5 - 19.5, 157.5 + 19.5), abs=1.0)


@needs_tags
@pytest.mark.parametrize("face", Face)
def test_rectangles_lie_on_their_face_inside_its_margin_and_look_outward(face: Face) -> None:
    edge, middle = 0.06, 0.186
    found = list(tag_rectangles(face, edge, middle))
    normal = np.array(FACES[face])
    module = edge / (MODULES + 2)
    assert not found[0][2]
    assert all(light for _, _, light in found[1:])
    for corners, own, _ in found:
        np.testing.assert_array_equal(own, normal)
        np.testing.assert_allclose(corners @ normal, 0.5 * edge)
        outline = np.cross(corners[1] - corners[0], corners[2] - corners[1])
        assert outline @ normal < 0.0  # clockwise to its looker, from the top left
        across = corners - (corners @ normal)[:, None] * normal - (0.0, 0.0, middle)
        assert np.abs(across).max() <= 0.5 * edge - module + 1e-12
    area = sum(np.linalg.norm(np.cross(c[1] - c[0], c[2] - c[1])) for c, _, _ in found[1:])
    assert area == pytest.approx(np.count_nonzero(pattern(face)) * module**2)


def test_a_world_of_colours_has_the_same_faces_whatever_its_tags_would_look_like() -> None:
    plain = Scene(PLANE, WorldParameters())
    other = Scene(PLANE, parameters(marker={"tag_light_rgb": [1, 2, 3], "tag_dark_rgb": [4, 5, 6]}))
    assert len(plain._faces) == len(other._faces) == 16
    for one, two in zip(plain._faces, other._faces, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


@needs_tags
def test_the_colour_of_light_and_dark_is_what_the_parameters_say() -> None:
    marker = {"kind": "tags", "tag_light_rgb": [200, 0, 0], "tag_dark_rgb": [0, 0, 200]}
    picture = marker_picture(parameters(marker=marker))
    assert picture[53 - 22, 157].argmax() == 0
    assert picture[53 - 17, 157].argmax() == 2


def test_tags_need_three_numbers_per_colour() -> None:
    with pytest.raises(ParameterError, match=r"marker\.tag_dark_rgb"):
        parameters(marker={"tag_dark_rgb": [1, 2]})
    with pytest.raises(ParameterError, match=r"marker\.kind"):
        from_mapping(WorldParameters, {"marker.kind": "tag"}, where="test")


def test_viewers_see_light_plates_where_the_tags_are() -> None:
    text = robot_description("leader", parameters(**TAGS), camera=False)
    assert text.count("rgb_200_200_200") == 3
    assert "rgb_205_14_16" not in text


@pytest.mark.parametrize("aruco", [None, SimpleNamespace(DICT_5X5_50=4, drawMarker=print)])
def test_an_opencv_without_tags_is_told_when_the_scene_is_made(
    monkeypatch: pytest.MonkeyPatch, aruco: SimpleNamespace | None
) -> None:
    monkeypatch.setattr(cv2, "aruco", aruco, raising=False)
    Scene(PLANE, WorldParameters())
    with pytest.raises(aruco_patterns.TagError, match="OpenCV"):
        Scene(PLANE, parameters(**TAGS))
    with pytest.raises(aruco_patterns.TagError, match="OpenCV"):
        pattern(Face.TARGET)
