"""Loads what rclpy otherwise loads when a node is made: a process that forks nodes does so once for all of them.

rclpy loads a message package's library when a first message of it is published or subscribed to.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from rcl_interfaces.msg import Log, ParameterEvent
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.type_description_service import GetTypeDescription  # type: ignore[attr-defined]
from rclpy.type_support import check_for_type_support
from std_srvs.srv import SetBool, Trigger

from robot_formation import conversions, names

_OF_EVERY_NODE = (
    *(Log, ParameterEvent),
    *(DescribeParameters, GetParameters, GetParameterTypes, ListParameters),
    *(SetParameters, SetParametersAtomically, GetTypeDescription),
)
_OF_OURS = (SetBool, Trigger)
_TOPICS = (
    *(topic for topic in vars(names).values() if isinstance(topic, names.Topic)),
    *(names.joint_states(), names.camera_request()),
)
"""Of every type that our nodes use at least one topic."""


def load_type_supports() -> None:
    """Load the type supports of all messages and services that our nodes use, as far as they are installed."""
    for interface in (*_OF_EVERY_NODE, *_OF_OURS, *_message_classes()):
        check_for_type_support(interface)


def _message_classes() -> Iterator[type[Any]]:
    for type_name in {topic.type for topic in _TOPICS}:
        with contextlib.suppress(ImportError):  # tf2_msgs is not on pip
            yield conversions.message_class(type_name)
