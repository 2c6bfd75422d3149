"""The leader on messages: bare ticks in and out, a straight step in between."""

from typing import Any

from component_helpers import wired
from robot_formation import conversions
from robot_formation.geometry.se2 import Motion

DONE = "/formation/leader/done"


def tick(number: int) -> Any:
    return conversions.uint32(number)


def moved(stamp_ns: int) -> Any:
    return conversions.displacement(Motion(0.05), "leader/base_link", stamp_ns)


def test_a_tour_on_messages() -> None:
    wire = wired("leader", "leader", timesteps=2, step_m=0.04)
    wire.component.start()
    assert [(topic, message.data) for topic, message in wire.sent] == [(DONE, 0)]
    for timestep in (1, 2):
        ((topic, message),) = wire.give("/formation/follower_1/done", tick(timestep - 1))
        assert topic == "move"
        assert conversions.read_move(message) == Motion(x_m=0.04)
        assert message.header.frame_id == "leader/base_link"
        ((topic, message),) = wire.give("moved", moved(timestep * 100))
        assert (topic, message.data) == (DONE, timestep)
        assert wire.component.stamp_ns == timestep * 100
    before = wire.component.exit_code
    assert before is None
    assert wire.give("/formation/follower_1/done", tick(2)) == []
    assert (wire.component.exit_code, wire.component.exit_reason) == (0, "all 2 timesteps driven")


def test_every_follower_is_waited_for() -> None:
    wire = wired("leader", "leader", followers=["follower_1", "follower_2"])
    wire.component.start()
    assert wire.give("/formation/follower_2/done", tick(0)) == []
    assert wire.component.details()["waiting for"] == "follower_1"
    assert [topic for topic, _ in wire.give("/formation/follower_1/done", tick(0))] == ["move"]


def test_stop_lets_the_step_end_and_start_goes_on() -> None:
    wire = wired("leader", "leader", timesteps=5)
    services = wire.component.services()
    wire.component.start()
    assert services["stop"]()[0]
    assert wire.give("/formation/follower_1/done", tick(0)) == []
    success, text = services["start"]()
    assert success
    assert "timestep 1" in text
    assert wire.sent[-1][0] == "move"


def test_a_moved_that_nobody_asked_for_sends_no_tick() -> None:
    wire = wired("leader", "leader")
    wire.component.start()
    assert wire.give("moved", moved(5)) == []
