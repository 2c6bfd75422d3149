"""Pan and side-length curves are those of the camera that made the pictures; areas are those of the blocks seen."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_formation.alignment.precise.marker_edges import EdgeParameters
from robot_formation.calibration.camera_edge_bias import edge_biases
from robot_formation.calibration.camera_fit import (
    alone_range,
    compared_distances,
    difference_px,
    face_views,
    fit_camera,
    pan_distances,
)
from robot_formation.calibration.camera_samples import CameraSample, overlay
from robot_formation.drive.curves import CalibrationError
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

EDGE_M, FOCAL_PX, CENTRE_PX, BIAS_PX = 0.06, 273.7, 157.5, 2.0


def block(signature: int, x: float, y: float, width: float, height: float) -> Block:
    """A block as an ideal camera would report it, in fractions of pixels; the real one has whole pixels."""
    return Block(signature, x, y, width, height)  # type: ignore[arg-type]


def seen(
    u: float,
    v: float,
    *,
    lens_right: float = 0.038,
    lens_ahead: float = 0.0,
    rounded: bool = False,
    focal: float = FOCAL_PX,
) -> CameraSample:
    """The Target block as a pinhole camera sees the face 3 cm to the right of the neighbour's middle."""
    depth = u + lens_right - EDGE_M / 2
    x = CENTRE_PX - focal * (v + lens_ahead) / depth
    side = focal * EDGE_M / depth - BIAS_PX
    if rounded:  # edges to the detector's cells of 2 px
        left, right = (2 * round((x + sign * side / 2) / 2) for sign in (-1, 1))
        x, side = (left + right) / 2, right - left
    return CameraSample(u, v, 0.0, True, 22, (block(Face.TARGET, x, 60, side, side - 1),))


def field(**camera: Any) -> list[CameraSample]:
    return [seen(u, v / 100, **camera) for u in (0.25, 0.3, 0.35, 0.4, 0.45) for v in range(-6, 7)]


@given(
    lens_right=st.floats(0.0, 0.08),
    lens_ahead=st.floats(-0.03, 0.03),
    focal=st.floats(150.0, 400.0),
)
def test_the_curves_of_a_pinhole_camera_are_found_exactly(lens_right: float, lens_ahead: float, focal: float) -> None:
    fit = fit_camera(face_views(field(lens_right=lens_right, lens_ahead=lens_ahead, focal=focal)), EDGE_M)
    distance = 0.32 + lens_right - EDGE_M / 2
    assert fit.distance_m == pytest.approx(distance, rel=1e-6)
    assert fit.slope_px_per_m == pytest.approx(focal / distance, rel=1e-6)
    assert fit.lead_m == pytest.approx(lens_ahead, abs=1e-6)
    assert fit.target_x_px == pytest.approx(CENTRE_PX - focal * lens_ahead / distance, abs=1e-4)
    assert fit.side_bias_px == pytest.approx(BIAS_PX, abs=1e-4)
    assert fit.side_px_m == pytest.approx(focal * EDGE_M, rel=1e-6)


def test_whole_pixels_leave_errors_as_large_as_the_fit_says() -> None:
    beside = [seen(0.24 + 0.005 * k, 0.0, rounded=True) for k in range(43)]
    fit = fit_camera(face_views([*field(rounded=True), *beside]), EDGE_M)
    truth = {"target_x_px": CENTRE_PX, "slope_px_per_m": FOCAL_PX / 0.328, "distance_m": 0.328, "side_bias_px": BIAS_PX}
    for name, value in truth.items():
        assert abs(getattr(fit, name) - value) < 4.0 * fit.errors[name]
    assert fit.column_rms_px == pytest.approx(2 / 12**0.5 / 2**0.5, rel=0.25)  # mean of two edges
    assert fit.side_rms_px == pytest.approx(2 / 12**0.5 * 2**0.5, rel=0.25)  # their difference


def test_the_window_and_the_difference_in_it_are_those_of_the_projection() -> None:
    views = face_views(field())
    fit = fit_camera(views, EDGE_M)
    half = FOCAL_PX / 0.328 * 0.03
    assert fit.window_px() == pytest.approx((CENTRE_PX - half, CENTRE_PX + half))
    expected = FOCAL_PX * 0.03 * (1 / 0.308 - 1 / 0.408)
    assert difference_px(views, [0.3, 0.35, 0.4])[0.03] == pytest.approx(expected)
    assert float(fit.column(0.4, 0.03) - fit.column(0.3, 0.03)) == pytest.approx(expected)
    assert pan_distances(views) == [0.25, 0.3, 0.35, 0.4, 0.45]
    assert compared_distances(pan_distances(views)) == [0.3, 0.35, 0.4]
    assert compared_distances([0.27, 0.36, 0.45]) == [0.27, 0.36, 0.45]


def test_only_whole_target_faces_of_a_parallel_follower_are_views() -> None:
    front = Block(Face.FRONT, 120, 60, 10, 40)
    good, beside = seen(0.3, 0.0), seen(0.3, 0.05)
    with_front = CameraSample(0.3, 0.05, 0.0, True, 22, (*beside.blocks, front))
    turned = CameraSample(0.3, 0.0, 15.0, True, 22, good.blocks)
    cut = CameraSample(0.3, 0.1, 0.0, True, 22, (Block(Face.TARGET, 20, 60, 34, 40),))
    views = face_views([with_front, turned, cut, CameraSample(0.3, 0.2, 0.0, True, 22), good])
    assert [(view.v_m, view.alone) for view in views] == [(0.0, True), (0.05, False)]


def test_views_that_do_not_determine_the_curves_are_refused() -> None:
    with pytest.raises(CalibrationError, match=r"0 views of the Target face.*smaller --step"):
        fit_camera([], EDGE_M)
    with pytest.raises(CalibrationError, match="too few"):
        fit_camera(face_views([seen(0.3, v / 100) for v in range(-5, 6)]), EDGE_M)
    same = Block(Face.TARGET, 150, 60, 40, 40)
    stuck = [CameraSample(s.u_m, s.v_m, 0.0, True, 22, (same,)) for s in field()]
    with pytest.raises(CalibrationError, match="lie on no"):
        fit_camera(face_views(stuck), EDGE_M)


def test_the_face_is_alone_up_to_the_first_place_that_shows_another() -> None:
    front = Block(Face.FRONT, 120, 60, 10, 40)
    places = [seen(0.3, v / 100) for v in range(-4, 7)]
    shown = [
        CameraSample(s.u_m, s.v_m, 0.0, True, 22, (*s.blocks, front)) if s.v_m in (0.04, 0.05) else s for s in places
    ]
    assert alone_range(face_views(shown), 0.3) == (-0.04, 0.03)
    assert alone_range(face_views(shown), 0.4) == (0.0, 0.0)


def looks(u: float, v: float, *signatures: Sequence[int] | None) -> list[CameraSample]:
    """A position's looks: signatures of each angle, None where the robots overlap."""
    return [
        CameraSample(u, v, angle, found is not None, 22, tuple(Block(s, 100, 50, 20, 20) for s in found or ()))
        for angle, found in enumerate(signatures)
    ]


def test_each_area_is_what_its_views_have_in_common() -> None:
    cases = {
        "unattainable": (None, None, None),
        "nothing": ((), None, ()),
        "front": ((Face.FRONT,), (Face.FRONT, Face.TARGET), ()),
        "target": ((Face.TARGET,), (), None),
        "rear": ((Face.REAR,), None, (Face.REAR, Face.TARGET)),
        "front or target": ((Face.FRONT, Face.TARGET), (Face.TARGET,), ()),
        "target or rear": ((), (Face.TARGET,), (Face.TARGET, Face.REAR)),
        "front or rear": ((Face.FRONT, Face.REAR), (), ()),
    }
    samples = [s for n, signatures in enumerate(cases.values()) for s in looks(n, 0.0, *signatures)]
    places = overlay(samples)
    assert [place.area for place in places] == list(cases)
    for place, signatures in zip(places, cases.values(), strict=True):
        assert place.angles == 3
        assert place.attainable == sum(found is not None for found in signatures)
        assert place.seen == sum(bool(found) for found in signatures)


def test_other_signatures_belong_to_no_area() -> None:
    assert overlay(looks(0.0, 0.0, (5,)))[0].area == "nothing"


def test_standard_errors_are_those_of_repeated_calibrations() -> None:
    rng = np.random.default_rng(5)
    fits = []
    for _ in range(100):
        noisy = [
            CameraSample(s.u_m, s.v_m, 0.0, True, 22, (block(Face.TARGET, b.x + rng.normal(0, 0.5), 60, side, side),))
            for s in field()
            for b in s.blocks
            for side in (b.width + rng.normal(0, 0.5),)
        ]
        fits.append(fit_camera(face_views(noisy), EDGE_M))
    for name in ("target_x_px", "slope_px_per_m", "distance_m", "side_bias_px"):
        spread = np.std([getattr(fit, name) for fit in fits])
        said = math.sqrt(np.mean([fit.errors[name] ** 2 for fit in fits]))
        assert said == pytest.approx(spread, rel=0.25), name


def face(left: float, right: float, top: float = 40.0, bottom: float = 90.0, slant: float = 0.0) -> NDArray[np.float64]:
    """Corners of a face: left top, left bottom, right top, right bottom."""
    return np.array([[left, top], [left, bottom], [right, top + slant], [right, bottom - slant]])


def reported(*blocks: tuple[int, float, float]) -> CameraSample:
    return CameraSample(0.3, 0.0, 0.0, True, 22, tuple(block(s, (a + b) / 2, 65, b - a, 46) for s, a, b in blocks))


def test_edge_biases_are_reported_minus_true_where_the_edge_is_what_it_seems() -> None:
    hidden = {Face.FRONT: face(200.0, 190.0), Face.REAR: face(160.0, 150.0)}  # turned away
    alone = (reported((Face.TARGET, 152, 198)), {Face.TARGET: face(150.0, 200.0), **hidden})
    sliver = (reported((Face.TARGET, 152, 206)), {Face.TARGET: face(150.0, 200.0), Face.FRONT: face(200.0, 206.0)})
    oblique = (reported((Face.TARGET, 152, 198)), {Face.TARGET: face(150.0, 200.0, slant=3.0), **hidden})
    cut = (reported((Face.TARGET, 2, 30)), {Face.TARGET: face(-10.0, 30.0), **hidden})
    behind: tuple[CameraSample, dict[Face, NDArray[np.float64]]] = (reported((Face.TARGET, 152, 198)), {})
    found = edge_biases([alone] * 3 + [sliver, oblique, cut, behind])
    assert {name: (bias.views, bias.mean_px, bias.scatter_px) for name, bias in found.items()} == {
        "target_left_px": (5, 2.0, 0.0),
        "target_right_px": (4, -2.0, 0.0),  # not the sliver's
        "target_top_px": (4, 2.0, 0.0),  # not that of the slanting edge
        "target_bottom_px": (4, -2.0, 0.0),
    }


def test_edges_of_neighbouring_faces_count_beside_the_target_block_only() -> None:
    faces = {Face.TARGET: face(150.0, 200.0), Face.FRONT: face(200.0, 230.0), Face.REAR: face(120.0, 150.0)}
    wide = reported((Face.TARGET, 152, 200), (Face.FRONT, 202, 229))
    narrow = reported((Face.TARGET, 152, 200), (Face.FRONT, 202, 208))
    rear = reported((Face.TARGET, 152, 200), (Face.REAR, 123, 150))
    small = CameraSample(
        0.6, 0.0, 0.0, True, 22, (Block(Face.TARGET, 176, 65, 48, 30), block(Face.REAR, 136.5, 65, 27, 30))
    )
    looks = [(look, faces) for look in (wide, narrow, rear, small) for _ in range(3)]
    found = edge_biases([*looks, (reported(), faces)])
    means = {name: bias.mean_px for name, bias in found.items()}
    assert means["front_left_px"] == 2.0
    assert means["front_right_px[3]"] == -1.0
    assert means["front_right_px[0]"] == -22.0
    assert means["rear_left_px[3]"] == 3.0
    assert means["rough_rear_left_px"] == 3.0
    assert found["target_left_px"].views == 6  # the looks with a Rear block
    assert {name.split("[")[0] for name in found} <= {field.name for field in dataclasses.fields(EdgeParameters)}
    assert edge_biases([(wide, faces)]) == {}  # one look has no scatter
