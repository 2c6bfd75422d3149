"""Publishers for the messages of a bag, with the quality of service that they were recorded with."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from robot_formation.bag.errors import BagError
from robot_formation.bag.qos import TopicQos
from robot_formation.names import Message

# What a best-effort publisher keeps: more than any burst of a bag needs.
_BEST_EFFORT_DEPTH = 100
_DELIVERED_S = 5.0


def republishing(profiles: Sequence[TopicQos]) -> QoSProfile:
    """Offer what a recorded topic's publishers offered, and drop nothing where that is possible.

    A subscriber that was served by one of the publishers is served again: the topic is reliable or transient local if
    any of them was. Reliable topics keep all, but for those that kept the last few for late subscribers: these get
    what they would have got.
    """
    reliable = not profiles or any(profile.reliability != "best_effort" for profile in profiles)
    latched = any(profile.durability == "transient_local" for profile in profiles)
    limited = latched and all(profile.history == "keep_last" and profile.depth > 0 for profile in profiles)
    depth = max((profile.depth for profile in profiles), default=0) if limited else _BEST_EFFORT_DEPTH
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST if limited or not reliable else HistoryPolicy.KEEP_ALL,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class Republisher:
    """Publishes raw messages on one topic, and waits where a topic that keeps all has no room for more.

    Args:
        node: where the publisher belongs; its remappings count.
        name: the topic.
        message_class: the type of its messages.
        profiles: what its publishers offered when it was recorded.
    """

    def __init__(self, node: Node, name: str, message_class: type[Message], profiles: Sequence[TopicQos]) -> None:
        qos = republishing(profiles)
        self._publisher = node.create_publisher(message_class, name, qos)
        self._depth = qos.depth if qos.history == HistoryPolicy.KEEP_LAST else 0
        self.latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self.sent = 0

    @property
    def depth(self) -> int:
        """Messages that late subscribers get of a transient-local topic; 0: all."""
        return self._depth

    @property
    def subscribers(self) -> int:
        """Subscriptions that have matched."""
        return int(self._publisher.get_subscription_count())

    def send(self, cdr: bytes, spin: Callable[[], None]) -> None:
        """Publish a serialised message; `spin` is called while there is no room for it.

        Raises:
            BagError: a subscriber has taken no message for seconds.
        """
        deadline = time.monotonic() + _DELIVERED_S
        while True:
            try:
                self._publisher.publish(cdr)
            except RuntimeError as error:  # rclpy's own, for lack of room
                if time.monotonic() > deadline:
                    topic = self._publisher.topic_name
                    raise BagError(f"{topic}: a subscriber takes no more messages; play at a lower rate") from error
                spin()
                continue
            self.sent += 1
            return

    def deliver(self, patience_s: float) -> None:
        """Wait until the subscribers have everything that was sent."""
        self._publisher.wait_for_all_acked(Duration(seconds=patience_s))
