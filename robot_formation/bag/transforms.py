"""Transforms for viewers, made from what a run publishes anyway: true poses and robot descriptions.

`/tf` has world -> <robot>/base_link at every true pose. `/tf_static` has the frames of each robot's description (wheels
at rest) and world -> <robot>/odom, where the robot started. Both lie in the formation's namespace: formations have
frames of the same names.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from robot_formation import names
from robot_formation.bag.odometry import ODOMETRY_TYPE, Layout, layout
from robot_formation.bag.transform_message import Transform, pose_of, text_of, transform_message
from robot_formation.geometry.orientation import Quaternion, Vector, quaternion

_POSES = re.compile(r"(.*)/ground_truth/([^/]+)/odom")
_DESCRIPTIONS = re.compile(r"(.*)/([^/]+)/robot_description")
_STRING = "std_msgs/msg/String"

_MOST_CHARACTERS = 10_000_000
_TOPICS = 1024  # more than any recording has: of so many is kept what their names mean


class TransformMessage(NamedTuple):
    """One serialised message of `/tf` or `/tf_static`; the topic's name is absolute."""

    topic: names.Topic
    cdr: bytes
    stamp_ns: int


class _Template(NamedTuple):
    """A true pose and the transform that was made of it: those of the robot's other poses differ in time and pose."""

    odometry: bytes
    places: Layout
    transform: bytes

    def of(self, odometry: bytes) -> bytes | None:
        """Return the transform of another true pose; None if that differs in more."""
        time, frames, pose = self.places
        same = (slice(time.start), *frames)
        if len(odometry) != len(self.odometry) or any(odometry[part] != self.odometry[part] for part in same):
            return None
        # The number of transforms comes before the time; the frames follow, and the pose's numbers in the same order.
        before, between = self.transform[: time.start + 4], self.transform[time.stop + 4 : pose.start - pose.stop]
        return before + odometry[time] + between + odometry[pose]


class Transforms:
    """Collects messages as they come, cheaply, and makes transforms of them when asked."""

    def __init__(self) -> None:
        self._templates: dict[tuple[str, str], _Template] = {}  # by namespace and robot
        self._taken: list[tuple[str, str, str, bytes, int]] = []
        self._static: defaultdict[str, dict[str, Transform]] = defaultdict(dict)  # by namespace and child frame

    def take(self, topic: str, type_name: str, cdr: bytes, stamp_ns: int) -> None:
        """Keep a message if it says where a frame is."""
        if match := _matched(topic, type_name):
            self._taken.append((match[1], match[2], type_name, cdr, stamp_ns))

    @staticmethod
    def wants(topic: str, type_name: str) -> bool:
        """Return whether messages of a topic say where frames are."""
        return _matched(topic, type_name) is not None

    @staticmethod
    def made_of(topic: str, type_name: str) -> dict[str, str]:
        """List the topics that are made of a topic's messages, absolute, with their types; none if it isn't used."""
        match = _matched(topic, type_name)
        return {} if match is None else made_in(match[1])

    def make(self) -> Iterator[TransformMessage]:
        """Make the transforms of what was taken since the last time."""
        taken, self._taken = self._taken, []
        new: defaultdict[str, list[int]] = defaultdict(list)
        for namespace, robot, type_name, cdr, stamp_ns in taken:
            template = self._templates.get((namespace, robot)) if type_name == ODOMETRY_TYPE else None
            if template is not None and (made := template.of(cdr)) is not None:
                yield TransformMessage(_inside(namespace, names.TF), made, stamp_ns)
                continue
            try:
                if type_name == _STRING:
                    fixed = list(_of_description(robot, text_of(cdr)))
                else:
                    pose = pose_of(cdr)
                    first = _message(_inside(namespace, names.TF), [pose], stamp_ns)
                    fixed = [pose._replace(child=f"{robot}/{names.ODOM_FRAME}")]
            except ValueError:  # what can't be read says of no frame where it is
                continue
            if type_name == ODOMETRY_TYPE:
                yield first
                if (places := layout(cdr)) is not None:
                    self._templates[namespace, robot] = _Template(cdr, places, first.cdr)
            for transform in fixed:
                if transform.child not in self._static[namespace]:
                    self._static[namespace][transform.child] = transform
                    new[namespace].append(stamp_ns)
        # All of them each time: whoever asks for the latest message on a latched topic gets one only.
        for namespace, stamps in new.items():
            yield _message(_inside(namespace, names.TF_STATIC), list(self._static[namespace].values()), min(stamps))


def made_in(namespace: str) -> dict[str, str]:
    """List the topics that are made for a formation in a namespace ('' or '/': the root), with their types."""
    return {made.name: made.type for made in (_inside(namespace.rstrip("/"), t) for t in (names.TF, names.TF_STATIC))}


@lru_cache(maxsize=_TOPICS)
def _matched(topic: str, type_name: str) -> re.Match[str] | None:
    """Match a topic that is used: groups are the formation's namespace and the robot."""
    pattern = {ODOMETRY_TYPE: _POSES, _STRING: _DESCRIPTIONS}.get(type_name)
    return None if pattern is None else pattern.fullmatch(topic)


@lru_cache(maxsize=_TOPICS)
def _inside(namespace: str, topic: names.Topic) -> names.Topic:
    return replace(topic, name=names.absolute(namespace, topic.name))


def description_root(text: str) -> ElementTree.Element | None:
    """Parse a robot's description (URDF); None for a text that is none."""
    if len(text) > _MOST_CHARACTERS or "<!DOCTYPE" in text:
        return None  # a description declares no entities, which small texts can make huge
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):
        return None


def origin_of(element: ElementTree.Element) -> tuple[Vector, Quaternion] | None:
    """Read where a part of a description lies in its link: place [m] and orientation; None if that is no place."""
    origin = element.find("origin")
    if origin is None:
        return (0.0, 0.0, 0.0), quaternion(0.0, 0.0, 0.0)
    try:
        return read_vector(origin.get("xyz", "0 0 0")), quaternion(*read_vector(origin.get("rpy", "0 0 0")))
    except ValueError:  # neither three nor numbers
        return None


def read_vector(text: str) -> Vector:
    """Read three numbers.

    Raises:
        ValueError: the text holds something else.
    """
    x, y, z = (float(number) for number in text.split())
    return (x, y, z)


def _of_description(robot: str, text: str) -> Iterator[Transform]:
    """Make one transform per joint of a URDF; a text that is none gives none."""
    root = description_root(text)
    for joint in [] if root is None else root.iter("joint"):
        parent, child, origin = joint.find("parent"), joint.find("child"), origin_of(joint)
        if parent is None or child is None or origin is None:
            continue
        yield Transform((0, 0), f"{robot}/{parent.get('link', '')}", f"{robot}/{child.get('link', '')}", *origin)


def _message(topic: names.Topic, transforms: Sequence[Transform], stamp_ns: int) -> TransformMessage:
    return TransformMessage(topic, transform_message(transforms), stamp_ns)
