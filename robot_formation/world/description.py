"""A robot as URDF, made from the world's parameters, for viewers."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

from robot_formation.names import ENCODER_WHEELS, WHEELS
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.scene import BACKDROP_THICKNESS_M, PEDESTAL_M

_WHEEL_WIDTH_M = 0.03
_ENCODER_WHEEL_WIDTH_M = 0.01
_PLATE_M = 0.002
_LENS_M = 0.02
_TO_OPTICAL_RPY = (-math.pi / 2, 0.0, -math.pi / 2)
_LIE_DOWN = {"y": (math.pi / 2, 0.0, 0.0), "x": (0.0, math.pi / 2, 0.0)}
"""Turns a URDF cylinder, which stands along z, so that it lies along an axis."""

Element = ElementTree.Element


def robot_description(name: str, parameters: WorldParameters, *, camera: bool) -> str:
    """Return a robot's URDF.

    Links: base_link, the four wheels, the two encoder wheels, marker and, for a robot that has one, camera_link (x
    along the view) and camera_optical_frame (x right, y down, z ahead). Joints of wheels are those of joint_states.
    Names carry no robot's name: viewers put `<robot>/` in front (RViz: TF Prefix).
    """
    robot = ElementTree.Element("robot", name=name)
    _add_base(robot, parameters)
    wheels = parameters.wheels
    for i, joint in enumerate(WHEELS):
        x = (0.5 if i < 2 else -0.5) * wheels.wheelbase_m
        y = (0.5 if i % 2 == 0 else -0.5) * wheels.track_m
        _add_wheel(robot, joint, (x, y, wheels.radius_m), wheels.radius_m, _WHEEL_WIDTH_M, (0.0, 1.0, 0.0))
    encoders = parameters.encoder_wheels
    radius = 0.5 * encoders.diameter_m
    places = (
        (encoders.v_wheel_x_m, encoders.v_wheel_y_m, radius),
        (encoders.u_wheel_x_m, encoders.u_wheel_y_m, radius),
    )
    # A wheel that rolls along +y turns about -x.
    for joint, place, axis in zip(ENCODER_WHEELS, places, ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)), strict=True):
        _add_wheel(robot, joint, place, radius, _ENCODER_WHEEL_WIDTH_M, axis)
    _add_marker(robot, parameters)
    if camera:
        _add_camera(robot, parameters)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def _add_base(robot: Element, parameters: WorldParameters) -> None:
    chassis, marker = parameters.chassis, parameters.marker
    size = (chassis.length_m, chassis.width_m, chassis.body_top_m - chassis.body_bottom_m)
    middle = (0.0, 0.0, 0.5 * (chassis.body_top_m + chassis.body_bottom_m))
    link = ElementTree.SubElement(robot, "link", name="base_link")
    inertial = ElementTree.SubElement(link, "inertial")
    _origin(inertial, (0.0, 0.0, chassis.mass_height_m))
    ElementTree.SubElement(inertial, "mass", value=_numbers((chassis.mass_kg,)))
    xx, yy, zz = (chassis.mass_kg / 12.0 * edge**2 for edge in size)
    moments = {"ixx": yy + zz, "ixy": 0.0, "ixz": 0.0, "iyy": xx + zz, "iyz": 0.0, "izz": xx + yy}
    ElementTree.SubElement(inertial, "inertia", {key: _numbers((value,)) for key, value in moments.items()})
    _box(link, "visual", size, middle, marker.body_rgb)
    _box(link, "collision", size, middle)
    foot = marker.top_m - marker.edge_m
    if foot > chassis.body_top_m:
        post = (PEDESTAL_M, PEDESTAL_M, foot - chassis.body_top_m)
        _box(link, "visual", post, (0.0, 0.0, 0.5 * (foot + chassis.body_top_m)), marker.body_rgb)
    if marker.backdrop_m > 0.0:
        board = (marker.backdrop_m, BACKDROP_THICKNESS_M, marker.top_m - chassis.body_top_m)
        place = (0.0, 0.5 * (marker.edge_m + BACKDROP_THICKNESS_M), 0.5 * (marker.top_m + chassis.body_top_m))
        _box(link, "visual", board, place, marker.backdrop_rgb)


def _add_wheel(
    robot: Element, joint: str, place: Sequence[float], radius_m: float, width_m: float, axis: Sequence[float]
) -> None:
    link = ElementTree.SubElement(robot, "link", name=joint)
    visual = ElementTree.SubElement(link, "visual")
    _origin(visual, (0.0, 0.0, 0.0), _LIE_DOWN["y" if axis[1] else "x"])
    geometry = ElementTree.SubElement(visual, "geometry")
    ElementTree.SubElement(geometry, "cylinder", radius=_numbers((radius_m,)), length=_numbers((width_m,)))
    _colour(visual, (60, 60, 60))
    _add_joint(robot, joint, "continuous", "base_link", joint, place, axis=axis)


def _add_marker(robot: Element, parameters: WorldParameters) -> None:
    marker = parameters.marker
    edge, half = marker.edge_m, 0.5 * marker.edge_m
    link = ElementTree.SubElement(robot, "link", name="marker")
    _box(link, "visual", (edge, edge, edge), (0.0, 0.0, 0.0), marker.body_rgb)
    # Thin plates are the coloured faces: URDF gives a box one colour only. Tags are left out.
    target, front, rear = marker.face_colours
    _box(link, "visual", (edge, _PLATE_M, edge), (0.0, -half, 0.0), target)
    _box(link, "visual", (_PLATE_M, edge, edge), (half, 0.0, 0.0), front)
    _box(link, "visual", (_PLATE_M, edge, edge), (-half, 0.0, 0.0), rear)
    dot = ElementTree.SubElement(link, "visual")
    _origin(dot, (0.0, 0.0, half))
    geometry = ElementTree.SubElement(dot, "geometry")
    ElementTree.SubElement(geometry, "cylinder", radius=_numbers((marker.dot_radius_m,)), length=_numbers((_PLATE_M,)))
    _colour(dot, marker.dot_rgb)
    _add_joint(robot, "marker_joint", "fixed", "base_link", "marker", (0.0, 0.0, marker.top_m - half))


def _add_camera(robot: Element, parameters: WorldParameters) -> None:
    camera = parameters.camera
    link = ElementTree.SubElement(robot, "link", name="camera_link")
    _box(link, "visual", (_LENS_M, _LENS_M, _LENS_M), (-0.5 * _LENS_M, 0.0, 0.0), (40, 40, 60))
    ElementTree.SubElement(robot, "link", name="camera_optical_frame")
    place = (camera.x_m, camera.y_m, camera.z_m)
    turn = (0.0, -math.radians(camera.tilt_deg), math.radians(camera.pan_deg))
    _add_joint(robot, "camera_joint", "fixed", "base_link", "camera_link", place, turn)
    lens = (0.0, 0.0, 0.0)
    _add_joint(robot, "camera_optical_joint", "fixed", "camera_link", "camera_optical_frame", lens, _TO_OPTICAL_RPY)


def _add_joint(
    robot: Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    place: Sequence[float],
    turn: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    axis: Sequence[float] = (),
) -> None:
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    _origin(joint, place, turn)
    if axis:
        ElementTree.SubElement(joint, "axis", xyz=_numbers(axis))


def _box(
    link: Element, use: str, size: Sequence[float], middle: Sequence[float], rgb: Sequence[int] | None = None
) -> None:
    part = ElementTree.SubElement(link, use)
    _origin(part, middle)
    ElementTree.SubElement(ElementTree.SubElement(part, "geometry"), "box", size=_numbers(size))
    if rgb is not None:
        _colour(part, rgb)


def _colour(visual: Element, rgb: Sequence[int]) -> None:
    material = ElementTree.SubElement(visual, "material", name="rgb_" + "_".join(map(str, rgb)))
    # Ours are linear light, viewers take gamma-encoded colours.
    shown = [(value / 255.0) ** (1.0 / 2.2) for value in rgb]
    ElementTree.SubElement(material, "color", rgba=_numbers([*shown, 1.0]))


def _origin(parent: Element, place: Sequence[float], turn: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    ElementTree.SubElement(parent, "origin", xyz=_numbers(place), rpy=_numbers(turn))


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value + 0.0:.6g}" for value in values)
