"""What a robot looks like, from its description (URDF)."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass

from robot_formation import names
from robot_formation.bag.transforms import description_root, origin_of, read_vector
from robot_formation.geometry.orientation import Quaternion, Vector, multiply, rotate

Rgb = tuple[int, int, int]
_GREY: Rgb = (90, 90, 90)
_UNTURNED: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Part:
    """A box, or a cylinder that stands along its own z axis.

    Attributes:
        size_m: of a box along x, y, z; of a cylinder radius and length.
        place_m: of its middle in its link.
        turn: orientation in its link.
        rgb: 0 to 255.
    """

    size_m: tuple[float, ...]
    place_m: Vector
    turn: Quaternion
    rgb: Rgb

    @property
    def is_box(self) -> bool:
        """Whether it is a box."""
        return len(self.size_m) == 3


@dataclass(frozen=True)
class Link:
    """A rigid piece of a robot.

    Attributes:
        name: of the link, and of the joint that turns it.
        place_m: in base_link.
        turn: orientation in base_link, with the joint at zero.
        axis: about which the joint turns it, in its own frame; None if it is fixed.
        parts: what is drawn.
    """

    name: str
    place_m: Vector
    turn: Quaternion
    axis: Vector | None
    parts: tuple[Part, ...]

    def turned(self, angle_rad: float) -> Quaternion:
        """Return the orientation in base_link with the joint at an angle."""
        if self.axis is None:
            return self.turn
        half = 0.5 * angle_rad
        x, y, z = (math.sin(half) * part for part in self.axis)
        return multiply(self.turn, (x, y, z, math.cos(half)))


def read_shape(description: str) -> tuple[Link, ...]:
    """Read a robot's links; a plain box, with the paper's robot's size, where a text describes no links.

    Meshes are left out, and so is whatever has no size.
    """
    root = description_root(description)
    links = () if root is None else tuple(_links(root))
    return links if any(link.parts for link in links) else (_PLAIN,)


_PLAIN = Link(
    names.BASE_FRAME, (0.0, 0.0, 0.0), _UNTURNED, None, (Part((0.2, 0.16, 0.1), (0.0, 0.0, 0.08), _UNTURNED, _GREY),)
)


def _links(root: ElementTree.Element) -> Iterator[Link]:
    joints = {}
    for joint in root.iter("joint"):
        child = joint.find("child")
        if child is not None:
            joints[child.get("link", "")] = joint
    for element in root.iter("link"):
        name = element.get("name", "")
        placed = _in_base(name, joints)
        if placed is not None:
            yield Link(name, *placed, _axis(joints.get(name)), tuple(_parts(element)))


def _in_base(name: str, joints: dict[str, ElementTree.Element]) -> tuple[Vector, Quaternion] | None:
    """Return a link's place and orientation in the root link; None if it has none there."""
    place, turn = (0.0, 0.0, 0.0), _UNTURNED
    for _ in range(len(joints) + 1):
        joint = joints.get(name)
        if joint is None:
            return place, turn
        origin, parent = origin_of(joint), joint.find("parent")
        if origin is None or parent is None:
            return None
        x, y, z = rotate(origin[1], place)
        place = (origin[0][0] + x, origin[0][1] + y, origin[0][2] + z)
        turn, name = multiply(origin[1], turn), parent.get("link", "")
    return None  # joints in a circle


def _axis(joint: ElementTree.Element | None) -> Vector | None:
    if joint is None or joint.get("type") not in ("continuous", "revolute"):
        return None
    axis = joint.find("axis")
    try:
        x, y, z = read_vector("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
    except ValueError:
        return None
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if 0.0 < length < math.inf else None


def _parts(link: ElementTree.Element) -> Iterator[Part]:
    for visual in link.iter("visual"):
        origin, size = origin_of(visual), _size(visual.find("geometry"))
        if origin is not None and size and all(0.0 < edge < math.inf for edge in size):
            yield Part(size, *origin, _rgb(visual))


def _size(geometry: ElementTree.Element | None) -> tuple[float, ...]:
    box = None if geometry is None else geometry.find("box")
    cylinder = None if geometry is None else geometry.find("cylinder")
    try:
        if box is not None:
            return read_vector(box.get("size", ""))
        if cylinder is not None:
            return float(cylinder.get("radius", "")), float(cylinder.get("length", ""))
    except ValueError:
        pass
    return ()


def _rgb(visual: ElementTree.Element) -> Rgb:
    colour = visual.find("material/color")
    try:
        red, green, blue, _ = (float(part) for part in ("" if colour is None else colour.get("rgba", "")).split())
        shown = [min(255, max(0, round(255.0 * part))) for part in (red, green, blue)]
        return (shown[0], shown[1], shown[2])
    except (ValueError, OverflowError):
        return _GREY
