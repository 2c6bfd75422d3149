"""From dots in pictures to robots: places, identities through contact, cover and the picture's edge."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.parameters import from_mapping
from robot_formation.surface import make_surface
from robot_formation.vision.overhead.camera_calibration import Locator
from robot_formation.vision.overhead.dot_tracking import OverheadTracker
from robot_formation.vision.overhead.dots import find_dots
from robot_formation.vision.overhead.tracking_parameters import (
    Calibration,
    ImperfectCalibration,
    OverheadTrackingParameters,
)
from robot_formation.world.overhead import OverheadCamera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface

Array = npt.NDArray[np.float64]

BOWL, PLANE = make_surface("bowl"), make_surface("plane")
RADIUS_PX = 3.8
AREA_PX = math.pi * RADIUS_PX**2


def dots_picture(
    centres: Sequence[tuple[float, float]] | Array, radius: float = RADIUS_PX, size: int = 512
) -> npt.NDArray[np.uint8]:
    """Grey 20 with white discs, each pixel by the share that a disc covers (8 x 8 samples)."""
    picture = np.full((size, size), 20.0)
    fine = (np.arange(8) + 0.5) / 8 - 0.5
    reach = math.ceil(radius) + 2
    for column, row in centres:
        columns = np.arange(max(0, int(column) - reach), min(size, int(column) + reach + 1))
        rows = np.arange(max(0, int(row) - reach), min(size, int(row) + reach + 1))
        if not len(columns) or not len(rows):
            continue
        dx = (columns[:, None] + fine).ravel() - column
        dy = (rows[:, None] + fine).ravel() - row
        inside = (dx[None] ** 2 + dy[:, None] ** 2 <= radius**2).reshape(len(rows), 8, len(columns), 8)
        part = picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        part[...] = np.maximum(part, 20.0 + 200.0 * inside.mean(axis=(1, 3)))
    whole: npt.NDArray[np.uint8] = np.rint(picture).astype(np.uint8)
    return whole


# --- finding dots -------------------------------------------------------------------------------------------------


@given(st.floats(20, 490), st.floats(20, 490))
@settings(max_examples=25, deadline=None)
def test_a_dots_centre_is_found_to_a_twentieth_of_a_pixel(column: float, row: float) -> None:
    (found,) = find_dots(dots_picture([(column, row)]), 120, AREA_PX)
    assert found == pytest.approx((column, row), abs=0.05)


@pytest.mark.parametrize("gap", [-0.5, 0.0, 1.0, 3.0])
@pytest.mark.parametrize("angle", [0.0, 0.5, 1.2])
def test_dots_that_touch_are_told_apart(gap: float, angle: float) -> None:
    half = (RADIUS_PX + 0.5 * gap) * np.array([math.cos(angle), math.sin(angle)])
    middle = np.array([200.3, 150.6])
    centres = np.array([middle - half, middle + half])
    found = find_dots(dots_picture(centres), 120, AREA_PX)
    assert len(found) == 2
    for centre in centres:
        assert np.linalg.norm(found - centre, axis=1).min() < 0.4


def test_three_dots_in_a_row_that_touch_are_three() -> None:
    centres = np.array([(100.0 + 7.6 * k, 80.0) for k in range(3)])
    found = find_dots(dots_picture(centres), 120, AREA_PX)
    assert found[np.argsort(found[:, 0])] == pytest.approx(centres, abs=0.5)


def test_dots_cut_off_by_the_edge_or_mostly_covered_are_not_reported() -> None:
    picture = dots_picture([(1.0, 200.0), (300.0, 510.0), (100.0, 100.0), (250.0, 250.0)])
    picture[:, 98:110] = 20
    assert find_dots(picture, 120, AREA_PX) == pytest.approx(np.array([[250.0, 250.0]]), abs=0.05)


def test_noise_and_an_empty_picture_give_no_dots() -> None:
    noise = np.random.default_rng(0).normal(60, 20, (512, 512)).clip(0, 255).astype(np.uint8)
    for picture in (noise, np.zeros((512, 512), np.uint8), np.full((512, 512), 255, np.uint8)):
        assert find_dots(picture, 150, AREA_PX).shape == (0, 2)


# --- places -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", ["bowl", "plane", "saddle", "gaussian_bump"])
def test_a_dots_place_follows_from_its_pixel_where_surface_and_lens_are_known(surface: str) -> None:
    ground = make_surface(surface)
    camera = OverheadCamera(ground, WorldParameters(), 0)
    locator = Locator(Calibration(), ground, 0.216)
    generator = np.random.default_rng(5)
    for _ in range(30):
        x, y = generator.uniform(0.1, 1.68, 2)
        pose = pose_on_surface(ground, x, y, generator.uniform(-3, 3))
        dot = np.array(pose.position) + pose.matrix() @ [0.0, 0.0, 0.216]
        (place,) = locator.places(camera.project(dot[None]))
        assert place == pytest.approx(dot, abs=1.5e-3)


def test_undistortion_inverts_opencvs_projection() -> None:
    """On a plane at the camera's own model nothing but undistortion is left."""
    flat = Calibration(knows_surface=False, plane_m=0.3)
    points = np.random.default_rng(6).uniform(0, 1.78, (40, 2))
    places = np.column_stack([points, np.full(40, 0.516)])
    local = (places - [0.89, 0.89, 2.5]) * [1.0, -1.0, -1.0]
    matrix = np.array([[560.0, 0, 257.3], [0, 560.0, 254.1], [0, 0, 1]])
    coefficients = np.array([-0.12, 0.02, 0.0006, -0.0004, 0.0])
    pixels, _ = cv2.projectPoints(local, np.zeros(3), np.zeros(3), matrix, coefficients)
    assert Locator(flat, PLANE, 0.216).places(pixels.reshape(-1, 2).astype(float)) == pytest.approx(places, abs=1e-6)


def test_the_imperfect_calibration_errs_by_centimetres_as_the_papers() -> None:
    camera = OverheadCamera(BOWL, WorldParameters(), 0)
    locator = Locator(ImperfectCalibration(), BOWL, 0.216)
    grid = [pose_on_surface(BOWL, x, y, 0.0) for x in np.linspace(0.2, 1.6, 8) for y in np.linspace(0.2, 1.6, 8)]
    dots = np.array([np.array(pose.position) + pose.matrix() @ [0.0, 0.0, 0.216] for pose in grid])
    errors = np.linalg.norm(locator.places(camera.project(dots))[:, :2] - dots[:, :2], axis=1)
    assert 0.01 < errors.max() < 0.027


# --- identities ---------------------------------------------------------------------------------------------------

# A pinhole at 2.5 m over a plane: one pixel is 4.08 mm at the dots' height.
FLAT = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0, "knows_surface": False}
PX_PER_M = 560.0 / (2.5 - 0.216)


def pixel(x: float, y: float) -> tuple[float, float]:
    return 257.3 + (x - 0.89) * PX_PER_M, 254.1 - (y - 0.89) * PX_PER_M


def follow(
    paths: dict[str, Array], hidden: Callable[[str, int], bool] = lambda name, frame: False, **values: Any
) -> tuple[OverheadTracker, dict[str, Array]]:
    """Track robots along paths (frames, 2); returns the tracker after checking every place against its own path."""
    parameters = from_mapping(OverheadTrackingParameters, {"good": FLAT, **values}, where="test")
    tracker = OverheadTracker(parameters, PLANE, {name: path[0] for name, path in paths.items()})
    for frame in range(len(next(iter(paths.values())))):
        seen = {name: path[frame] for name, path in paths.items() if not hidden(name, frame)}
        found = tracker.update(dots_picture([pixel(*place) for place in seen.values()]))
        for name, place in found.items():
            assert place[:2] == pytest.approx(paths[name][frame], abs=3e-3), f"{name} in frame {frame}"
    return tracker, found


def line(start: tuple[float, float], end: tuple[float, float], frames: int) -> Array:
    return np.linspace(start, end, frames)


def test_dots_that_touch_while_they_pass_keep_their_names() -> None:
    side = RADIUS_PX / PX_PER_M
    paths = {
        "leader": line((0.6, 0.9 + side), (1.2, 0.9 + side), 41),
        "follower_1": line((1.2, 0.9 - side), (0.6, 0.9 - side), 41),
    }
    assert set(follow(paths)[1]) == set(paths)


def test_dots_that_touch_and_part_again_keep_their_names() -> None:
    near = 1.95 * RADIUS_PX / PX_PER_M
    distance = np.concatenate([np.linspace(0.3, near, 20), np.full(10, near), np.linspace(near, 0.3, 20)])
    one = np.column_stack([0.9 - distance / 2, np.full(50, 0.7)])
    assert set(follow({"a": one, "b": one * (-1, 1) + (1.8, 0)})[1]) == {"a", "b"}


def test_a_dot_that_leaves_the_picture_and_comes_back_is_the_same_robots() -> None:
    out_and_back = np.concatenate([line((1.5, 0.9), (2.1, 0.9), 15), line((2.1, 0.9), (1.5, 0.9), 15)])
    other = np.concatenate([line((1.2, 0.9), (1.6, 0.9), 15), line((1.6, 0.9), (1.2, 0.9), 15)])
    tracker, found = follow({"leader": other, "follower_1": out_and_back})
    assert set(found) == {"leader", "follower_1"}
    assert tracker.tracks["follower_1"].missed == 0


@pytest.mark.parametrize("covered", [("leader",), ("follower_1",), ("leader", "follower_1")])
def test_dots_that_are_covered_while_they_drive_keep_their_names(covered: tuple[str, ...]) -> None:
    paths = {"leader": line((0.76, 0.2), (0.76, 1.15), 20), "follower_1": line((1.08, 0.2), (1.08, 1.15), 20)}
    _, found = follow(paths, hidden=lambda name, frame: name in covered and 6 <= frame < 12)
    assert set(found) == set(paths)


def test_stop_and_go_of_a_formation_keeps_names_through_covers_and_long_moves() -> None:
    """Moves of up to 20 cm, one robot at a time, dots hidden at random: as in a run, and worse."""
    generator = np.random.default_rng(8)
    names = ["leader", "follower_1", "follower_2"]
    places = {name: np.array([0.4 + 0.32 * n, 0.3]) for n, name in enumerate(names)}
    paths = {name: [place.copy()] for name, place in places.items()}
    for turn in range(60):
        name = names[turn % 3]
        places[name] = places[name] + (generator.uniform(-0.02, 0.02), 0.05 if turn % 6 < 3 else -0.045)
        for other in names:
            paths[other].append(places[other].copy())
    covers = generator.random((3, 61)) < 0.2
    follow({n: np.array(p) for n, p in paths.items()}, hidden=lambda name, f: f > 0 and covers[names.index(name), f])
    ahead = np.array([[0.5, 0.5], [0.5, 0.7], [0.5, 0.7], [0.5, 0.9], [0.5, 0.9], [0.4, 0.9], [0.4, 0.9]])
    beside = np.array([[0.82, 0.5], [0.82, 0.5], [0.82, 0.7], [0.82, 0.7], [0.82, 0.9], [0.82, 0.9], [0.72, 0.9]])
    _, found = follow({"a": ahead, "b": beside})
    assert set(found) == {"a", "b"}


def test_a_hidden_robots_place_is_its_last_and_no_other_dot_is_taken_for_it() -> None:
    paths = {"leader": np.full((12, 2), 0.6), "follower_1": np.full((12, 2), (0.92, 0.6))}
    tracker, found = follow(paths, hidden=lambda name, frame: name == "leader" and frame > 3)
    assert set(found) == {"follower_1"}
    assert tracker.tracks["leader"].missed == 8
    assert tracker.tracks["leader"].place[:2] == pytest.approx((0.6, 0.6), abs=1e-3)


def test_ten_robots_are_followed() -> None:
    start = {f"robot_{n}": np.array([0.3 + 0.28 * (n % 5), 0.5 + 0.5 * (n // 5)]) for n in range(10)}
    steps = np.cumsum(np.random.default_rng(9).uniform(-0.02, 0.02, (10, 25, 2)), axis=1)
    _, found = follow({name: place + steps[n] for n, (name, place) in enumerate(start.items())})
    assert len(found) == 10


def test_restart_expects_the_starts_again() -> None:
    path = line((0.5, 0.5), (1.3, 0.5), 30)
    tracker, _ = follow({"leader": path})
    tracker.restart()
    found = tracker.update(dots_picture([pixel(0.5, 0.5)]))
    assert found["leader"][:2] == pytest.approx((0.5, 0.5), abs=1e-3)


def test_robots_that_are_put_back_to_their_starts_are_found_there_at_once() -> None:
    paths = {"leader": line((0.4, 0.4), (1.4, 0.4), 30), "follower_1": line((0.4, 0.7), (0.4, 1.5), 30)}
    tracker, _ = follow(paths)
    assert not tracker.restarted
    starts = {name: path[0] for name, path in paths.items()}
    found = tracker.update(dots_picture([pixel(*place) for place in starts.values()]))
    assert tracker.restarted
    for name, place in starts.items():
        assert found[name][:2] == pytest.approx(place, abs=1e-3)
    tracker.update(dots_picture([pixel(*place) for place in starts.values()]))
    assert not tracker.restarted


def test_another_threshold_and_calibration_count_from_the_next_picture_on_and_tracks_go_on() -> None:
    tracker, _ = follow({"leader": line((0.5, 0.5), (0.9, 0.5), 20)})
    starts = {"leader": (0.5, 0.5)}
    tracker.configure(
        from_mapping(OverheadTrackingParameters, {"good": FLAT, "threshold": 254}, where="test"), PLANE, starts
    )
    assert tracker.update(dots_picture([pixel(0.9, 0.5)]) // 2) == {}
    moved = {**FLAT, "x_m": 0.89 + 0.1}
    tracker.configure(from_mapping(OverheadTrackingParameters, {"good": moved}, where="test"), PLANE, starts)
    found = tracker.update(dots_picture([pixel(0.9, 0.5)]))
    assert found["leader"][:2] == pytest.approx((1.0, 0.5), abs=2e-3)
