"""Which topics are recorded or played: by name, by regular expression, or all but some."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field

from robot_formation.bag.errors import BagError
from robot_formation.names import DIAGNOSTICS, IMAGE_TYPE
from robot_formation.parameters import suggestion

_IMAGE_TYPES = (IMAGE_TYPE, "sensor_msgs/msg/CompressedImage")


@dataclass(frozen=True)
class Selection:
    """A choice of topics. Without names and regex, all are chosen but hidden ones (a part begins with `_`).

    Attributes:
        topics: absolute names that are chosen in any case.
        regex: those that it matches as a whole are chosen too.
        exclude: those that it matches as a whole are left out, unless they are named in `topics`.
        images: whether pictures that are not named in `topics` may be chosen.
        namespace: where those lie that are not named in `topics`, and `/diagnostics`, which all share; empty: anywhere.

    Raises:
        BagError: one of the expressions is no regular expression.
    """

    topics: Collection[str] = ()
    regex: str = ""
    exclude: str = ""
    images: bool = True
    namespace: str = ""
    _regex: re.Pattern[str] = field(init=False, repr=False, compare=False)
    _exclude: re.Pattern[str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_regex", _compiled(self.regex, "regex"))
        object.__setattr__(self, "_exclude", _compiled(self.exclude, "exclude"))

    @property
    def everything(self) -> bool:
        """Whether nothing is named or matched: all topics are meant."""
        return not self.topics and not self.regex

    def wants(self, topic: str, type_name: str) -> bool:
        """Return whether a topic is chosen.

        Args:
            topic: its absolute name.
            type_name: its message type in full.
        """
        if topic in self.topics:
            return True
        if self.namespace and not topic.startswith(f"{self.namespace}/") and topic != DIAGNOSTICS.name:
            return False
        if self.exclude and self._exclude.fullmatch(topic):
            return False
        if type_name in _IMAGE_TYPES and not self.images:
            return False
        if self.regex:
            return self._regex.fullmatch(topic) is not None
        return self.everything and "/_" not in topic

    def check(self, known: Collection[str], where: object) -> None:
        """Check that every topic that is named exists.

        Raises:
            BagError: naming the first that doesn't.
        """
        for topic in self.topics:
            if topic not in known:
                raise BagError(f"{where} has no topic '{topic}'{suggestion(topic, known)}")


def _compiled(text: str, what: str) -> re.Pattern[str]:
    try:
        return re.compile(text)
    except re.error as error:
        raise BagError(f"'{text}' for '{what}' is no regular expression: {error}") from None
