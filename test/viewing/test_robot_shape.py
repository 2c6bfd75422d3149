"""A robot's looks out of its description."""

import math

import pytest

from robot_formation.geometry.orientation import rotate
from robot_formation.names import ENCODER_WHEELS, OPTICAL_FRAME, WHEELS
from robot_formation.viewing.robot_shape import Link, read_shape
from robot_formation.world.description import robot_description
from robot_formation.world.parameters import WorldParameters


def links(*, camera: bool = True) -> dict[str, Link]:
    return {link.name: link for link in read_shape(robot_description("robot", WorldParameters(), camera=camera))}


def test_wheels_turn_and_nothing_else_does() -> None:
    assert {name for name, link in links().items() if link.axis is not None} == {*WHEELS, *ENCODER_WHEELS}


def test_wheels_stand_where_the_world_has_them() -> None:
    wheels = WorldParameters().wheels
    front_left = links()[WHEELS[0]]
    assert front_left.place_m == pytest.approx((wheels.wheelbase_m / 2, wheels.track_m / 2, wheels.radius_m))
    (part,) = front_left.parts
    assert not part.is_box
    assert part.size_m[0] == wheels.radius_m


def test_a_wheel_that_rolls_forward_turns_its_top_forward() -> None:
    wheel = links()[WHEELS[0]]
    assert rotate(wheel.turned(math.pi / 2), (0.0, 0.0, 1.0)) == pytest.approx((1.0, 0.0, 0.0))
    assert wheel.turned(0.0) == wheel.turn


def test_the_markers_faces_have_their_colours() -> None:
    parts = links()["marker"].parts
    target = next(part for part in parts if part.place_m[1] < -0.02)
    front = next(part for part in parts if part.place_m[0] > 0.02)
    rear = next(part for part in parts if part.place_m[0] < -0.02)
    brightest = [face.rgb.index(max(face.rgb)) for face in (target, front, rear)]
    assert brightest == [0, 1, 2]  # red, green, blue


def test_the_camera_looks_to_the_left() -> None:  # to what six digits of a description hold
    optical = links()[OPTICAL_FRAME]
    assert rotate(optical.turn, (0.0, 0.0, 1.0)) == pytest.approx((0.0, 1.0, 0.0), abs=1e-5)
    assert rotate(optical.turn, (0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, -1.0), abs=1e-5)
    camera = WorldParameters().camera
    assert optical.place_m == pytest.approx((camera.x_m, camera.y_m, camera.z_m))
    assert OPTICAL_FRAME not in links(camera=False)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no description",
        "<robot/>",
        "<!DOCTYPE robot []><robot/>",
        '<robot><link name="a"><visual><geometry><box size="1 2"/></geometry></visual></link></robot>',
        '<robot><link name="a"><visual><geometry><mesh filename="a.stl"/></geometry></visual></link></robot>',
        '<robot><link name="a"><visual><geometry><box size="1 nan -2"/></geometry></visual></link></robot>',
        '<robot><link name="a"/><joint><child link="a"/><parent link="a"/></joint></robot>',
    ],
)
def test_what_describes_no_robot_is_drawn_as_a_box(text: str) -> None:
    (link,) = read_shape(text)
    assert link.name == "base_link"
    assert link.parts[0].is_box


@pytest.mark.parametrize(("rgba", "shown"), [("2 -1 0.5 1", (255, 0, 128)), ("nan 0 0 1", None), ("red", None)])
def test_colours_out_of_range_are_cut(rgba: str, shown: tuple[int, ...] | None) -> None:
    text = (
        '<robot><link name="a"><visual><geometry><box size="1 1 1"/></geometry>'
        f'<material><color rgba="{rgba}"/></material></visual></link></robot>'
    )
    (link,) = read_shape(text)
    assert link.parts[0].rgb == (shown or (90, 90, 90))
