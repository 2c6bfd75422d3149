"""The recorder's diagnostics, which stay out of its own bag."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping

from rclpy.node import Node

from robot_formation import conversions, names
from robot_formation.nodes.host.qos import qos_profile

OK, WARNING = 0, 1
_WORD_BYTES = 4  # a middleware delivers whole words
_REMEMBERED = 32  # of its own messages: many more than can be on their way


class RecorderHealth:
    """Publishes how a recording goes, and knows its own messages again.

    Args:
        node: the recorder's.
        bag: where it writes.
    """

    def __init__(self, node: Node, bag: str) -> None:
        topic = names.DIAGNOSTICS
        self._publisher = node.create_publisher(
            conversions.message_class(topic.type), topic.name, qos_profile(topic.qos)
        )
        self._name = node.get_fully_qualified_name()
        self._own = (node.get_name(), node.get_namespace())
        self._bag = bag
        self._sent: deque[bytes] = deque(maxlen=_REMEMBERED)

    @property
    def topic(self) -> str:
        """The topic's name, remapped or not."""
        return str(self._publisher.topic_name)

    def publishes(self, name: str, namespace: str) -> bool:
        """Return whether a publisher of this node and namespace is the recorder itself."""
        return (name, namespace) == self._own

    def is_own(self, topic: str, cdr: bytes) -> bool:
        """Return whether a message that came is one that was sent from here; each is known once."""
        if topic != self.topic or (message := _whole_words(cdr)) not in self._sent:
            return False
        self._sent.remove(message)
        return True

    def publish(
        self, stamp_ns: int, messages: int, topics: int, waiting_bytes: int, dropped: Counter[str], lost: Counter[str]
    ) -> None:
        """Report the state: a warning as soon as anything is missing.

        Args:
            stamp_ns: the bag's time, nanoseconds.
            messages: taken so far.
            topics: recorded.
            waiting_bytes: what waits for the disk.
            dropped: by topic, what the queue had no room for.
            lost: by topic, what the middleware has lost.
        """
        missing = {"dropped": sum(dropped.values()), "lost": sum(lost.values())}
        text = ", ".join(f"{count} messages {what}" for what, count in missing.items() if count)
        values: Mapping[str, object] = {
            "bag": self._bag,
            "topics": topics,
            "messages": messages,
            "waiting [B]": waiting_bytes,
            **missing,
        }
        report = conversions.diagnostics(
            self._name,
            WARNING if text else OK,
            text or "recording",
            {key: str(value) for key, value in values.items()},
            stamp_ns,
        )
        cdr = conversions.to_cdr(report)
        self._sent.append(_whole_words(cdr))
        self._publisher.publish(cdr)


def _whole_words(cdr: bytes) -> bytes:
    return cdr + bytes(-len(cdr) % _WORD_BYTES)
