"""One formation's part of a bag, wherever its namespace lies."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping

from robot_formation import names
from robot_formation.bag.errors import BagError
from robot_formation.bag.reader import Bag, BagMessage
from robot_formation.bag.source import RawMessage
from robot_formation.parameters import suggestion

# What only a follower's own nodes exchange: by these topics a formation is found. `odom` is not among them, which
# ground truth has too.
_OF_FOLLOWERS = (
    names.MOVE,
    names.MOVED,
    names.DISPLACEMENT,
    names.RESIDUAL,
    names.COMMANDED,
    names.PREDICTION,
    names.FORECAST,
    names.ALIGNMENT,
    names.BLOCKS,
    names.camera_image(),
    names.joint_commands(),
    names.joint_states(),
)
_FOLLOWERS = re.compile(
    rf"(.*)/follower_[1-9]\d*/(?:{'|'.join(re.escape(topic.name) for topic in _OF_FOLLOWERS)})", re.DOTALL
)


def formation_namespaces(topics: Iterable[str]) -> list[str]:
    """Find the namespaces ('' is the root) that hold topics of followers, sorted."""
    return sorted({match[1] for topic in topics if (match := _FOLLOWERS.fullmatch(topic))})


class FormationBag:
    """The topics of one formation in an open bag, named as if the formation's namespace were the root.

    Attributes:
        bag: the whole bag.
        namespace: the formation's; '' is the root.
    """

    def __init__(self, bag: Bag, namespace: str | None = None) -> None:
        """Choose a formation.

        Args:
            bag: the open bag.
            namespace: where the formation's robots lie, '/' for the root; None: wherever there is one.

        Raises:
            BagError: there are several to choose from, or none in this namespace.
        """
        self.bag = bag
        self.path = bag.path
        self.namespace = _chosen(bag, namespace)

    @property
    def topics(self) -> dict[str, str]:
        """The formation's topics that hold at least one message, with their message types."""
        start = f"{self.namespace}/"
        return {
            topic[len(self.namespace) :]: type_name
            for topic, type_name in self.bag.topics.items()
            if topic.startswith(start)
        }

    def metadata(self, name: str) -> dict[str, str]:
        """See `Bag.metadata`."""
        return self.bag.metadata(name)

    def require(self, types: Mapping[str, str]) -> None:
        """See `Bag.require`."""
        self.bag.require({self._full(topic): type_name for topic, type_name in types.items()})

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[BagMessage]:
        """See `Bag.messages`."""
        for message in self.bag.messages([self._full(topic) for topic in topics], start_ns, stop_ns):
            yield message._replace(topic=message.topic[len(self.namespace) :])

    def raw_messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """See `Bag.raw_messages`."""
        for message in self.bag.raw_messages([self._full(topic) for topic in topics]):
            yield message._replace(topic=message.topic[len(self.namespace) :])

    def _full(self, topic: str) -> str:
        return f"{self.namespace}{topic}"


def _chosen(bag: Bag, wanted: str | None) -> str:
    found = formation_namespaces(bag.topics)
    if wanted is not None:
        namespace = f"/{wanted.strip('/')}".rstrip("/")
        if namespace not in found:
            shown = [each or "/" for each in found]
            hint = suggestion(namespace or "/", shown) if shown else ""
            raise BagError(f"{bag.path} has no formation in the namespace '{namespace or '/'}'{hint}")
        return namespace
    if len(found) > 1:
        raise BagError(
            f"{bag.path} holds several formations, in {', '.join(each or '/' for each in found)}: "
            "choose one by --namespace"
        )
    return found[0] if found else ""
