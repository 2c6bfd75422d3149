"""Who counts as a listener in place of the one that is expected."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from robot_formation.names import DISPLACEMENT
from robot_formation.nodes.host.outbox import Outbox


class Listeners:
    """A node whose topic has these subscribers; publishers count them."""

    topic_name = "/follower_1/displacement"

    def __init__(self, *names: str) -> None:
        self._names = names

    def get_subscriptions_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        assert topic == self.topic_name
        return [SimpleNamespace(node_name=name, node_namespace="/follower_1") for name in self._names]

    def get_subscription_count(self) -> int:
        return len(self._names)


@pytest.mark.parametrize(
    ("subscribers", "matched", "stood_in"),
    [
        ((), False, False),
        (("predictor",), True, True),
        (("my_predictor",), False, True),
        (("progress",), False, False),
        (("viewer",), False, False),
        (("_monitor",), False, False),
        (("progress", "my_predictor"), False, True),
        (("progress", "predictor"), True, True),
    ],
)
def test_only_a_node_of_the_users_stands_in_for_the_predictor(
    subscribers: Sequence[str], matched: bool, stood_in: bool
) -> None:
    node: Any = Listeners(*subscribers)
    outbox = Outbox(node, patience_s=60.0, recorder="", record_images=False, warn=lambda text: None)
    outbox.add(DISPLACEMENT, node)
    assert outbox._matched(DISPLACEMENT) == matched
    assert outbox._stood_in(DISPLACEMENT) == stood_in
