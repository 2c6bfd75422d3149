"""Takes the raw messages of one topic, and counts those that are missing between them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from robot_formation.bag.losses import LossCounter
from robot_formation.names import Message


class Intake:
    """Subscribes to a topic and hands on what comes.

    Losses show in the sequence numbers of the message info; a middleware that gives none can't tell of them. Its own
    events of lost messages are not asked for: Fast DDS blocks for ever when a message is lost while such an event is
    taken, since the two take the locks of event and reader in opposite orders.

    Args:
        node: subscribes.
        topic: the topic's name.
        message_class: its type.
        qos: what is asked of its publishers.
        publishers: how many there are.
        take: called with every serialised message.

    Attributes:
        publishers: how many the topic has now; to be kept up to date.
        lost: messages that are missing so far.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        message_class: type[Message],
        qos: QoSProfile,
        publishers: int,
        take: Callable[[bytes], None],
    ) -> None:
        self.publishers = publishers
        self.lost = 0
        self.qos = qos
        self._take = take
        self._losses = LossCounter()
        node.create_subscription(message_class, topic, _with_info(self._on_message), qos, raw=True)

    def _on_message(self, data: bytes, info: Any) -> None:
        number = info.get("publication_sequence_number")
        if number is not None:
            self.lost += self._losses.take(number, self.publishers)
        self._take(data)


def _with_info(take: Callable[[bytes, Any], None]) -> Callable[..., None]:
    """Make a callback for message and info: the event-driven executor of rclpy 7.1 gives both as one argument."""

    def callback(*arguments: Any) -> None:
        data, info = arguments if len(arguments) == 2 else arguments[0]
        take(data, info)

    # By the signature rclpy decides whether the info is wanted.
    callback.__signature__ = inspect.signature(lambda data, info: None)  # type: ignore[attr-defined]
    return callback
