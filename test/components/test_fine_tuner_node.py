"""The fine-tuner on messages: its neighbour's tick in, moves, frame requests, reports and its own tick out."""

import math
from collections.abc import Sequence
from typing import Any

import pytest

from component_helpers import Wire, wired
from robot_formation import conversions, exit_codes
from robot_formation.alignment.paper_mode import AlignmentParameters, PaperAlignment
from robot_formation.geometry.se2 import Motion
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

BASE, CAMERA = "follower_1/base_link", "follower_1/camera_optical_frame"
IN_PLACE = [Block(Face.TARGET, 158, 60, 49, 49)]
LOOK = {"frames": 1, "stable_frames": 1}
LONGEST_LOOK = 200
NEIGHBOUR, OWN = "/formation/leader/done", "/formation/follower_1/done"


def tick(number: int) -> Any:
    return conversions.uint32(number)


def blocks(found: Sequence[Block], stamp_ns: int) -> Any:
    return conversions.blocks(found, CAMERA, stamp_ns)


def planar(motion: Motion, stamp_ns: int) -> Any:
    return conversions.displacement(motion, BASE, stamp_ns)


@pytest.fixture
def wire() -> Wire:
    return wired("fine_tuner", "follower_1", mode="paper", look=LOOK)


def plain(sent: Sequence[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """Topics with the data of plain messages."""
    return [(topic, getattr(message, "data", None)) for topic, message in sent]


def begin(wire: Wire) -> None:
    """Go through timestep 0 and the first move."""
    wire.give(NEIGHBOUR, tick(0))
    wire.give("blocks", blocks(IN_PLACE, 10))
    wire.give(NEIGHBOUR, tick(1))
    wire.give("moved", planar(Motion(0.049, -0.002), 20))


def test_timesteps_0_and_1_on_messages(wire: Wire) -> None:
    assert plain(wire.give(NEIGHBOUR, tick(0))) == [("alignment", "align"), ("camera/request", 1)]
    assert plain(wire.give("blocks", blocks(IN_PLACE, 10))) == [("alignment", "aligned"), (OWN, 0)]
    (state, (topic, message)) = wire.give(NEIGHBOUR, tick(1))
    assert state[1].data == "collect"
    assert topic == "move"
    assert conversions.read_move(message) == Motion(0.05)
    assert message.header.frame_id == BASE
    assert plain(wire.give("moved", planar(Motion(0.049, -0.002), 20))) == [("camera/request", 1)]
    sent = wire.give("blocks", blocks(IN_PLACE, 30))
    assert [topic for topic, _ in sent] == ["alignment", "commanded", "displacement", "residual"]
    commanded, displacement, residual = (message for _, message in sent[1:])
    assert {conversions.stamp_of(message) for _, message in sent[1:]} == {30}
    assert {message.header.frame_id for _, message in sent[1:]} == {BASE}
    assert conversions.read_displacement(commanded) == Motion(0.05)
    assert conversions.has_estimate(commanded)
    assert conversions.read_displacement(displacement) == Motion(0.049, -0.002)
    expected = PaperAlignment(AlignmentParameters()).offset(IN_PLACE)
    assert conversions.read_displacement(residual) == expected
    assert conversions.has_estimate(residual)
    assert plain(wire.give("prediction", planar(Motion(0.05), 30))) == [(OWN, 1)]
    assert wire.component.details() == {"timestep": "2", "waiting for": "neighbour"}
    assert wire.warnings == []


def test_a_report_without_the_target_face_says_that_the_residual_is_no_estimate() -> None:
    wire = wired("fine_tuner", "follower_1", mode="paper", look=LOOK, alignment={"max_moves": 1})
    begin(wire)
    front = [Block(Face.FRONT, 158, 60, 40, 40)]
    wire.give("blocks", blocks(front, 30))
    wire.give("moved", planar(Motion(-0.05), 40))
    sent = dict(wire.give("blocks", blocks(front, 50)))
    assert not conversions.has_estimate(sent["residual"])
    assert conversions.has_estimate(sent["displacement"])


def test_the_second_follower_listens_to_the_first_and_not_to_the_leader() -> None:
    wire = wired("fine_tuner", "follower_2", done_listeners=0)
    assert OWN in wire.inputs
    assert NEIGHBOUR not in wire.inputs
    (done,) = [topic for topic in wire.component.outputs() if topic.name == "/formation/follower_2/done"]
    assert done.listeners == ()


def cut_off(message: Any) -> Any:
    message.data = message.data[:-1]
    return message


def test_bad_blocks_warn_and_do_not_count_as_a_frame(wire: Wire) -> None:
    begin(wire)
    bad = cut_off(blocks(IN_PLACE, 30))
    assert wire.give("blocks", bad) == []
    assert "cut off" in wire.warnings[0]
    assert wire.component.details()["waiting for"] == "look"
    assert len(wire.give("blocks", blocks(IN_PLACE, 31))) == 4


def test_a_moved_that_is_not_finite_warns_and_stays_out_of_the_displacement(wire: Wire) -> None:
    wire.give(NEIGHBOUR, tick(0))
    wire.give("blocks", blocks(IN_PLACE, 10))
    wire.give(NEIGHBOUR, tick(1))
    assert plain(wire.give("moved", planar(Motion(math.nan, 0.0), 20))) == [("camera/request", 1)]
    assert "not finite" in wire.warnings[0]
    sent = dict(wire.give("blocks", blocks(IN_PLACE, 30)))
    assert conversions.read_displacement(sent["displacement"]) == Motion()
    assert not conversions.has_estimate(sent["commanded"])


@pytest.mark.parametrize(
    ("topic", "message"), [("moved", planar(Motion(0.1), 5)), ("prediction", planar(Motion(0.1), 5))]
)
def test_answers_that_nobody_asked_for_warn_and_change_nothing(wire: Wire, topic: str, message: Any) -> None:
    assert wire.give(topic, message) == []
    assert "nobody asked for" in wire.warnings[0]
    assert wire.component.details() == {"timestep": "0", "waiting for": "neighbour"}


def test_a_lost_leader_ends_the_run_with_the_exit_code_for_it() -> None:
    wire = wired("fine_tuner", "follower_1", mode="paper", look=LOOK, alignment={"max_empty_looks": 1})
    wire.give(NEIGHBOUR, tick(0))
    assert plain(wire.give("blocks", blocks([], 10))) == [("alignment", "lost: no block in view")]
    assert wire.component.exit_code == exit_codes.LOST == 3
    assert wire.component.exit_reason == "follower_1 lost its beacon neighbour in timestep 0: no block in view"


@pytest.mark.parametrize("schedule", ["wave", "together", "timer"])
def test_where_others_may_go_on_a_follower_that_is_lost_holds_still(schedule: str) -> None:
    wire = wired(
        "fine_tuner", "follower_1", mode="paper", look=LOOK, alignment={"max_empty_looks": 1}, schedule=schedule
    )
    if schedule == "timer":
        wire.component.start()
    else:
        wire.give(NEIGHBOUR if schedule == "wave" else "/formation/leader/begun", tick(0))
    for stamp_ns in range(10, 10 + LONGEST_LOOK):
        wire.give("blocks", blocks([], stamp_ns))
    assert wire.component.exit_code is None
    assert wire.component.held_code == exit_codes.LOST
    assert wire.warnings == ["follower_1 lost its beacon neighbour in timestep 0: no block in view"]
    sent = len(wire.sent)
    for topic in wire.inputs:
        if topic.startswith("/formation/"):
            wire.give(topic, tick(1))
    wire.give("blocks", blocks(IN_PLACE, 1000))
    assert len(wire.sent) == sent
