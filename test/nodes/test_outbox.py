"""Who counts as a listener in place of the one that is expected."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from robot_formation.names import DISPLACEMENT
from robot_formation.nodes.host.outbox import Outbox


class Listeners:
    """A node whose topic has these subscribers; publishers count them, but for those called `unmatched`."""

    topic_name = "/follower_1/displacement"

    def __init__(self, *names: str) -> None:
        self._names = names
        self.published: list[str] = []

    def publish(self, message: str) -> None:
        self.published.append(message)

    def get_subscriptions_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        assert topic == self.topic_name
        return [SimpleNamespace(node_name=name, node_namespace="/follower_1") for name in self._names]

    def get_subscription_count(self) -> int:
        return len([name for name in self._names if name != "unmatched"])


@pytest.mark.parametrize(
    ("subscribers", "matched", "patience_s"),
    [
        ((), False, 60.0),
        (("predictor",), True, 20.0),
        (("my_predictor",), False, 5.0),
        (("progress",), False, 60.0),
        (("viewer",), False, 60.0),
        (("_monitor",), False, 60.0),
        (("progress", "my_predictor"), False, 5.0),
        (("progress", "predictor"), True, 20.0),
    ],
)
def test_only_a_node_of_the_users_stands_in_for_the_predictor(
    subscribers: Sequence[str], matched: bool, patience_s: float
) -> None:
    node: Any = Listeners(*subscribers)
    outbox = Outbox(node, patience_s=60.0, recorder="", record_images=False, warn=lambda text: None)
    outbox.add(DISPLACEMENT, node)
    assert outbox._matched(DISPLACEMENT) == matched
    assert outbox._patience_for(DISPLACEMENT) == patience_s


@pytest.mark.parametrize(
    ("subscribers", "matched", "patience_s"),
    [
        (("predictor",), False, 60.0),
        (("predictor", "fine_tuner", "somebody"), False, 60.0),
        (("my_predictor",), False, 60.0),
        (("my_predictor", "recorder"), False, 5.0),
        (("predictor", "recorder"), True, 20.0),
    ],
)
def test_nobody_stands_in_for_the_recorder(subscribers: Sequence[str], matched: bool, patience_s: float) -> None:
    node: Any = Listeners(*subscribers)
    recorder = "/follower_1/recorder"
    outbox = Outbox(node, patience_s=60.0, recorder=recorder, record_images=False, warn=lambda text: None)
    outbox.add(DISPLACEMENT, node)
    assert outbox._matched(DISPLACEMENT) == matched
    assert outbox._patience_for(DISPLACEMENT) == patience_s


@pytest.mark.parametrize(
    ("subscribers", "sent_after_s"),
    [
        (("predictor",), 0.0),
        (("my_predictor",), 5.0),
        (("predictor", "unmatched"), 20.0),
        (("progress",), 60.0),
        ((), 60.0),
    ],
)
def test_a_first_message_waits_for_its_listener_a_while_for_a_stand_in_and_no_longer_than_patience_lasts(
    monkeypatch: pytest.MonkeyPatch, subscribers: Sequence[str], sent_after_s: float
) -> None:
    warnings: list[str] = []
    now_s = [100.0]
    monkeypatch.setattr("robot_formation.nodes.host.outbox.time", SimpleNamespace(monotonic=lambda: now_s[0]))
    node: Any = Listeners(*subscribers)
    outbox = Outbox(node, patience_s=60.0, recorder="", record_images=False, warn=warnings.append)
    outbox.add(DISPLACEMENT, node)
    outbox.send(DISPLACEMENT, "first")
    for waited_s in range(62):
        if node.published:
            break
        now_s[0] = 100.0 + waited_s
        outbox.flush()
    assert sent_after_s <= now_s[0] - 100.0 <= sent_after_s + 1.0
    assert bool(warnings) == (sent_after_s > 0.0)
    outbox.send(DISPLACEMENT, "second")
    assert node.published == ["first", "second"]
