"""Holds messages back until their listeners are there, so that discovery can't swallow the first ones."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robot_formation.names import IMAGE_TYPE, ONLOOKERS, Message, Topic, absolute

_STAND_IN_S = 5.0
_UNMATCHED_S = 20.0
"""Subscribers that have been seen match so much later at most where 40 nodes start at once; one with an incompatible
quality of service never does."""


class Outbox:
    """Publishes in order; a topic's first message waits, at most for a while, until all its listeners have matched.

    A reliable publisher that has matched a subscription delivers everything that it publishes from then on, so nothing
    needs to be known of the other side. Where a listener doesn't come but another node has subscribed in its place,
    that one counts after a while; hidden nodes (names that begin with an underscore) and the one that tells the
    progress never do.
    """

    def __init__(
        self,
        node: Node,
        *,
        patience_s: float,
        recorder: str,
        record_images: bool,
        warn: Callable[[str], None],
    ) -> None:
        self._node = node
        self._patience_s = patience_s
        self._recorder = recorder
        self._record_images = record_images
        self._warn = warn
        self._publishers: dict[Topic, Publisher] = {}
        self._ready: set[Topic] = set()
        self._waiting: deque[tuple[Topic, Message]] = deque()
        self._since: float | None = None

    def add(self, topic: Topic, publisher: Publisher) -> None:
        """Make a topic known."""
        self._publishers[topic] = publisher
        recorded = self._recorder and (self._record_images or topic.type != IMAGE_TYPE)
        if not topic.listeners and not recorded:
            self._ready.add(topic)

    @property
    def waiting(self) -> bool:
        """Whether messages are held back."""
        return bool(self._waiting)

    def send(self, topic: Topic, message: Message) -> None:
        """Publish now, or as soon as everything sent before is out and the listeners are there."""
        self._waiting.append((topic, message))
        self.flush()

    def flush(self) -> None:
        """Publish what need not wait any more."""
        while self._waiting:
            topic, message = self._waiting[0]
            if topic not in self._ready and not self._matched(topic):
                if self._since is None:
                    self._since = time.monotonic()
                waited_s = time.monotonic() - self._since
                if waited_s < self._patience_for(topic):
                    return
                self._warn(f"nobody listens to {self._publishers[topic].topic_name}: going on")
            self._since = None
            self._ready.add(topic)
            self._publishers[topic].publish(message)
            self._waiting.popleft()

    def _matched(self, topic: Topic) -> bool:
        """Return whether all listeners, the recorder and whoever else has subscribed have matched."""
        publisher = self._publishers[topic]
        found = self._subscriptions(topic)
        names = {info.node_name for info in found}
        return (
            self._is_recorded(topic, found)
            and names.issuperset(topic.listeners)
            and publisher.get_subscription_count() >= len(found)
        )

    def _patience_for(self, topic: Topic) -> float:
        """Return how long a first message waits, s: less where others listen in place of those that are missing.

        That may be a user's own predictor, say. Nobody stands in for the recorder.
        """
        found = self._subscriptions(topic)
        others = {info.node_name for info in found if _full_name(info) != self._recorder}
        missing = set(topic.listeners) - others
        others = {name for name in others if not name.startswith("_")} - ONLOOKERS - set(topic.listeners)
        if not self._is_recorded(topic, found) or len(missing) > len(others):
            return self._patience_s
        return min(self._patience_s, _STAND_IN_S if missing else _UNMATCHED_S)

    def _subscriptions(self, topic: Topic) -> list[TopicEndpointInfo]:
        return list(self._node.get_subscriptions_info_by_topic(self._publishers[topic].topic_name))

    def _is_recorded(self, topic: Topic, found: list[TopicEndpointInfo]) -> bool:
        """Return whether the recorder listens, or need not."""
        recorded = self._recorder and (self._record_images or topic.type != IMAGE_TYPE)
        return not recorded or self._recorder in {_full_name(info) for info in found}


def _full_name(info: TopicEndpointInfo) -> str:
    return absolute(info.node_namespace, info.node_name)
