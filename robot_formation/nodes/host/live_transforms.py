"""/tf and /tf_static during a run, from the node that publishes the true poses, where tf2_msgs is installed."""

from __future__ import annotations

from collections.abc import Iterator

from robot_formation import conversions, names
from robot_formation.bag.transforms import Transforms
from robot_formation.names import Message


def transform_topics() -> list[names.Topic]:
    """List the topics that can be published here: none without tf2_msgs, which is not on pip."""
    topics = [names.TF, names.TF_STATIC]
    try:
        for topic in topics:
            conversions.message_class(topic.type)
    except ImportError:
        return []
    return topics


class LiveTransforms:
    """Makes the transforms that go with a message; they are the same as those that a recorder would make.

    Args:
        namespace: that of the node, absolute.
    """

    def __init__(self, namespace: str) -> None:
        self._namespace = namespace
        self._maker = Transforms()
        self._topics = {names.absolute(namespace, topic.name): topic for topic in (names.TF, names.TF_STATIC)}

    def of(self, topic: names.Topic, message: Message) -> Iterator[tuple[names.Topic, bytes]]:
        """Yield topics with serialised messages; nothing for a message that says of no frame where it is.

        Args:
            topic: as the node names it.
            message: what is published on it.
        """
        name = names.absolute(self._namespace, topic.name)
        if self._maker.wants(name, topic.type):
            # The stamps in the messages count; that of the log is the recorder's business.
            self._maker.take(name, topic.type, conversions.to_cdr(message), 0)
            for made in self._maker.make():
                yield self._topics[made.topic.name], made.cdr
