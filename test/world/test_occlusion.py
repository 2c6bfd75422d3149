"""Leaving out robots that a nearer one hides must not change a picture, in any pixel."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.surface import make_surface
from robot_formation.world.camera import Camera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface
from world_helpers import parameters

GROUND = make_surface("bowl", {"size_m": 6.0, "curvature_per_m": 0.02})
BOARDS = parameters(marker={"backdrop_m": 0.16, "backdrop_rgb": (60, 60, 60)})
LOOKING = pose_on_surface(GROUND, 1.4, 3.0, 0.0)


def camera(world: WorldParameters, *, draws_all: bool = False) -> Camera:
    made = Camera(GROUND, world)
    if draws_all:
        made._occlusion._has_screens = False
    return made


def row(number: int, ahead_m: float = 0.0) -> list[Pose]:
    """Robots 32 cm from each other, each so much ahead of the one before it, near to far; they stand uphill."""
    return [pose_on_surface(GROUND, 1.4 + ahead_m * i, 3.0 + 0.32 * i, 0.0) for i in range(1, number + 1)]


@functools.cache
def cameras(board_m: float, body_m: float, bottom_m: float, tilt_deg: float, eye_m: float) -> tuple[Camera, Camera]:
    world = parameters(
        marker={"backdrop_m": board_m, "backdrop_rgb": (200, 30, 90)},
        chassis={"length_m": body_m, "body_bottom_m": bottom_m},
        camera={"tilt_deg": tilt_deg, "z_m": eye_m},
    )
    return camera(world), camera(world, draws_all=True)


@pytest.mark.parametrize(("eye_m", "bottom_m"), [(0.03, 0.06), (0.126, 0.012), (0.2, 0.012)])
@settings(max_examples=300)
@given(
    board_m=st.sampled_from([0.08, 0.16, 0.4]),
    body_m=st.sampled_from([0.1, 0.365]),
    tilt_deg=st.sampled_from([-15.0, 0.0, 10.0]),
    y_m=st.sampled_from([1.0, 3.0]),
    headings=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    near=st.tuples(st.floats(-0.1, 0.1), st.floats(0.2, 0.9)),
    behind=st.tuples(st.floats(-0.12, 0.12), st.floats(0.25, 0.8)),
)
def test_a_picture_is_that_of_all_robots(
    eye_m: float,
    bottom_m: float,
    board_m: float,
    body_m: float,
    tilt_deg: float,
    y_m: float,
    headings: tuple[float, float, float],
    near: tuple[float, float],
    behind: tuple[float, float],
) -> None:
    looking = pose_on_surface(GROUND, 1.4, y_m, headings[0])
    u, v = near
    far_u, far_v = u * (1.0 + behind[1] / v) + behind[0], v + behind[1]  # so much aside of the line of sight
    others = [
        pose_on_surface(GROUND, 1.4 + u, y_m + v, headings[1]),
        pose_on_surface(GROUND, 1.4 + far_u, y_m + far_v, headings[2]),
    ]
    quick, whole = cameras(board_m, body_m, bottom_m, tilt_deg, eye_m)
    if len(quick.may_see(looking, others)) < len(whole.may_see(looking, others)):
        assert np.array_equal(quick.light(looking, others), whole.light(looking, others))


@pytest.mark.parametrize("ahead_m", [0.0, 0.05])
def test_robots_behind_the_nearest_ones_body_and_board_are_not_seen(ahead_m: float) -> None:
    robots = row(10, ahead_m)
    assert camera(BOARDS).may_see(LOOKING, robots) == robots[:1]
    assert camera(BOARDS, draws_all=True).may_see(LOOKING, robots) == robots[::-1]


def test_a_robot_whose_marker_stands_out_beside_the_board_is_seen() -> None:
    robots = row(4, ahead_m=0.05)
    robots[2] = pose_on_surface(GROUND, 1.8, 3.96, 0.0)
    assert camera(BOARDS).may_see(LOOKING, robots) == [robots[2], robots[0]]
    without = camera(BOARDS).light(LOOKING, [robots[0], robots[1], robots[3]])
    assert not np.array_equal(camera(BOARDS).light(LOOKING, robots), without)


@pytest.mark.parametrize(
    ("world", "what"),
    [
        (WorldParameters(), "no board"),
        (parameters(marker={"backdrop_m": 0.16}, camera={"near_m": 0.3}), "the nearest one before the near plane"),
    ],
)
def test_nothing_is_left_out_where_the_nearest_robot_hides_nothing(world: WorldParameters, what: str) -> None:
    robots = row(4)
    assert camera(world).may_see(LOOKING, robots) == robots[::-1], what


def test_a_lens_below_the_bodies_which_have_no_lower_face_may_see_all() -> None:
    steep = make_surface("bowl", {"size_m": 6.0, "curvature_per_m": 0.2})
    world = parameters(marker={"backdrop_m": 0.16}, camera={"z_m": 0.0}, chassis={"body_bottom_m": 0.06})
    robots = [pose_on_surface(steep, 3.0, 3.0 + 0.32 * i, 0.0) for i in range(1, 5)]
    assert Camera(steep, world).may_see(pose_on_surface(steep, 3.0, 3.0, 0.0), robots) == robots[::-1]
