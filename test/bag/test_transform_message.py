"""Messages read and made without a library are those of rosbags."""

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.bag.transform_message import Transform, pose_of, text_of, transform_message
from synthetic_bag import STORE, T, header, odometry, text

NUMBERS = st.floats(allow_nan=False)
NAMES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)
ORDERS = st.booleans()
TRANSFORMS = st.builds(
    Transform,
    st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)),
    NAMES,
    NAMES,
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS),
)


def of_rosbags(transform: Transform) -> Any:
    stamp = T["builtin_interfaces/msg/Time"](*transform.stamp)
    place, turn = (
        T["geometry_msgs/msg/Vector3"](*transform.place),
        T["geometry_msgs/msg/Quaternion"](*transform.turn),
    )
    return T["geometry_msgs/msg/TransformStamped"](
        T["std_msgs/msg/Header"](stamp, transform.parent),
        transform.child,
        T["geometry_msgs/msg/Transform"](place, turn),
    )


@given(st.lists(TRANSFORMS, max_size=4))
def test_transforms_are_serialised_as_by_rosbags(transforms: list[Transform]) -> None:
    message = T["tf2_msgs/msg/TFMessage"]([of_rosbags(each) for each in transforms])
    assert transform_message(transforms) == bytes(STORE.serialize_cdr(message, "tf2_msgs/msg/TFMessage"))


@given(TRANSFORMS, ORDERS)
def test_an_odometrys_pose_is_read_in_both_byte_orders(expected: Transform, little: bool) -> None:
    message = odometry(0, 0.0, 0.0, 0.0)
    message.header = T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](*expected.stamp), expected.parent)
    message.child_frame_id = expected.child
    message.pose.pose.position = T["geometry_msgs/msg/Point"](*expected.place)
    message.pose.pose.orientation = T["geometry_msgs/msg/Quaternion"](*expected.turn)
    cdr = bytes(STORE.serialize_cdr(message, "nav_msgs/msg/Odometry", little_endian=little))
    assert pose_of(cdr) == expected
    for end in (*range(0, len(cdr), 7), len(cdr) - 1):
        with pytest.raises(ValueError):
            pose_of(cdr[:end])


@given(NAMES, ORDERS)
def test_a_text_is_read_in_both_byte_orders(words: str, little: bool) -> None:
    cdr = bytes(STORE.serialize_cdr(text(words), "std_msgs/msg/String", little_endian=little))
    assert text_of(cdr) == words
    for end in range(len(cdr)):
        with pytest.raises(ValueError):
            text_of(cdr[:end])


@pytest.mark.parametrize(
    "data",
    [b"\0\1\0\0" + struct.pack("<I", 0), b"\0\1\0\0" + struct.pack("<I", 3) + b"abc", b"\0\1\0\0\2\0\0\0\xff\0"],
    ids=["no zero byte", "no end", "no UTF-8"],
)
def test_a_text_that_is_none_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError):
        text_of(data)


@pytest.mark.parametrize("head", [b"\0\3", b"\0\x0b", b"\1\1"], ids=["parameter list", "version 2", "no CDR"])
def test_a_message_that_is_serialised_in_another_way_is_refused(head: bytes) -> None:
    with pytest.raises(ValueError, match="no plain CDR"):
        text_of(head + transform_message([])[2:])


def test_numbers_that_are_none_pass_through() -> None:
    message = odometry(3, math.nan, math.inf, 0.0)
    message.header = header(3, "world")
    found = pose_of(bytes(STORE.serialize_cdr(message, "nav_msgs/msg/Odometry")))
    assert math.isnan(found.place[0])
    assert found.place[1] == math.inf
