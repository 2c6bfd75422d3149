"""What all components have in common: their topics, their health, and one table that lists them."""

import pytest

from component_helpers import Wire, wired
from robot_formation import names
from robot_formation.components.base import Component, Place
from robot_formation.components.catalogue import KINDS
from robot_formation.conversions import message_class

ROBOT_OF = {"world": "", "drive": "leader", "leader": "leader"}


@pytest.fixture(params=sorted(KINDS))
def wire(request: pytest.FixtureRequest) -> Wire:
    return wired(request.param, ROBOT_OF.get(request.param, "follower_1"))


def test_topics_of_a_component_have_different_names_and_message_types_that_exist(wire: Wire) -> None:
    topics = [entry.topic for entry in wire.component.inputs()] + wire.component.outputs()
    assert len({topic.name for topic in topics}) == len(topics)
    for topic in topics:
        assert message_class(topic.type).__name__ == topic.type.rsplit("/", 1)[-1]


def test_nothing_is_sent_before_the_start_and_nobody_is_finished(wire: Wire) -> None:
    assert wire.sent == []
    assert wire.component.exit_code is None


def test_a_warning_is_said_counted_and_shown_as_health(wire: Wire) -> None:
    component = wire.component
    assert (component.health().level, component.health().text) == (0, "ok")
    component.warn("first")
    component.warn("second")
    assert wire.said == [(1, "first"), (1, "second")]
    health = component.health()
    assert (health.level, health.text, health.values["warnings"]) == (1, "second", "2")
    assert all(isinstance(value, str) for value in health.values.values())


def test_only_the_world_ever_has_work_of_its_own(wire: Wire) -> None:
    assert not wire.component.busy


def test_a_component_that_is_not_attached_says_so_when_it_sends() -> None:
    with pytest.raises(RuntimeError, match="nothing is connected to move"):
        Component(Place("leader"))._send(names.MOVE, None)


def test_frames_belong_to_the_robot_if_there_is_one() -> None:
    assert Place("leader").frame("base_link") == "leader/base_link"
    assert Place("").frame("base_link") == "base_link"


@pytest.mark.parametrize(
    ("kind", "robots"),
    [
        ("world", [""]),
        ("drive", ["leader", "follower_1", "follower_2"]),
        ("leader", ["leader"]),
        ("predictor", ["follower_1", "follower_2"]),
        ("fine_tuner", ["follower_1", "follower_2"]),
        ("block_detector", ["follower_1", "follower_2"]),
    ],
)
def test_the_catalogue_knows_which_robots_have_a_node(kind: str, robots: list[str]) -> None:
    assert KINDS[kind].robots_of(2) == robots


@pytest.mark.parametrize("robot", ["follower_1", "follower_2"])
@pytest.mark.parametrize("kind", ["drive", "block_detector", "predictor", "fine_tuner"])
def test_a_followers_component_hears_only_its_own_namespace_and_its_neighbours_tick(kind: str, robot: str) -> None:
    tick = names.formation_done(names.beacon_neighbour(robot)).name
    foreign = {name for name in wired(kind, robot).inputs if name.startswith("/") or ".." in name}
    assert foreign == ({tick} if kind == "fine_tuner" else set())
