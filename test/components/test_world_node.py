"""The world on messages: it moves what it is told to, shows what it is asked for, and refuses what cannot be meant."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest

from component_helpers import Wire, wired
from robot_formation import conversions
from robot_formation.components.world import WorldComponent, surface_mesh
from robot_formation.drive.movement_system import WheelCommand
from robot_formation.names import WHEELS
from robot_formation.parameters import ParameterError
from robot_formation.surface import make_surface, surface_from_texts
from robot_formation.world.world import World

COMMANDS, REQUEST, IMAGE = "follower_1/joint_commands", "follower_1/camera/request", "follower_1/camera/image_raw"


def world_of(wire: Wire) -> World:
    assert isinstance(wire.component, WorldComponent)
    return wire.component._world


@pytest.fixture
def wire() -> Iterator[Wire]:
    found = wired("world", "", surface="plane", camera={"mode": "on_demand"}, seed=3)
    found.component.start()
    yield found
    world_of(found).close()


def command(angles: tuple[float, ...] = (1.0,) * 4, limits: tuple[float, ...] = (4.0,) * 4) -> Any:
    return conversions.joint_command(WheelCommand(angles, limits), 0)


def run(wire: Wire) -> list[tuple[str, Any]]:
    """Let the world do all it owes; what it sends."""
    before = len(wire.sent)
    while wire.component.busy:
        wire.component.work()
    return wire.sent[before:]


def of(sent: Sequence[tuple[str, Any]], topic: str) -> list[Any]:
    return [message for name, message in sent if name == topic]


def test_the_start_shows_the_ground_the_cameras_the_clock_and_every_robot(wire: Wire) -> None:
    topics = [topic for topic, _ in wire.sent]
    assert topics[:2] == ["surface", "follower_1/camera/camera_info"]
    assert {"clock", "leader/robot_description", "follower_1/robot_description"} <= set(topics)
    for robot in ("leader", "follower_1"):
        assert {f"ground_truth/{robot}/{what}" for what in ("odom", "pose", "path")} <= set(topics)
    (info,) = of(wire.sent, "follower_1/camera/camera_info")
    assert (info.width, info.height, info.k[0]) == (316, 208, 273.7)
    assert conversions.to_ns(of(wire.sent, "clock")[0].clock) == 0
    assert not wire.component.busy


def test_a_command_moves_the_robot_until_it_rests_and_the_last_joint_states_say_so(wire: Wire) -> None:
    assert wire.give(COMMANDS, command()) == []
    assert wire.component.busy
    sent = run(wire)
    states = of(sent, "follower_1/joint_states")
    assert all(any(message.velocity) for message in states[:-1])
    assert not any(states[-1].velocity)
    positions, _ = conversions.read_joint_states(states[-1])
    assert positions[:4] == pytest.approx([1.0] * 4, abs=0.5)
    stamps = [conversions.to_ns(message.clock) for message in of(sent, "clock")]
    assert stamps == sorted(set(stamps))
    assert stamps[-1] == conversions.stamp_of(states[-1]) == wire.component.stamp_ns
    assert not of(sent, "leader/joint_states")
    assert wire.warnings == []


def test_the_ground_truth_is_in_the_world_with_velocities_in_the_robots_frame(wire: Wire) -> None:
    wire.give(COMMANDS, command((3.0,) * 4))
    odometry = of(run(wire), "ground_truth/follower_1/odom")
    driving = odometry[len(odometry) // 2]
    assert (driving.header.frame_id, driving.child_frame_id) == ("world", "follower_1/base_link")
    # The robot looks along world y: its forward velocity is x in its own frame.
    assert driving.twist.twist.linear.x > 0.02
    assert abs(driving.twist.twist.linear.y) < 0.01
    assert odometry[-1].pose.pose.position.y > odometry[0].pose.pose.position.y + 0.02


def nan_at(place: int, what: str) -> Any:
    values = [1.0] * 4
    values[place] = math.nan
    return command(**{what: tuple(values)})


def named(names: Sequence[str]) -> Any:
    message = command()
    message.name = list(names)
    return message


@pytest.mark.parametrize(
    "bad",
    [
        nan_at(0, "angles"),
        nan_at(3, "limits"),
        command((math.inf, 1, 1, 1)),
        command((1.0,) * 3),
        command((1e9, 0, 0, 0)),
        command((500.0, 0, 0, 0)),
        command(limits=(0.0,) * 4),
        command(limits=(-4.0,) * 4),
        command(limits=(1e3,) * 4),
        named(WHEELS[:3]),
        named(()),
    ],
    ids=[
        "an angle is nan",
        "a limit is nan",
        "an angle is infinite",
        "three angles",
        "an absurd angle",
        "beyond the motor's range",
        "no speed",
        "a negative speed",
        "too fast",
        "three names",
        "no names",
    ],
)
def test_a_bad_command_warns_moves_nothing_and_is_answered(wire: Wire, bad: Any) -> None:
    before = world_of(wire).ground_truth("follower_1")
    assert wire.give(COMMANDS, bad) == []
    (answer,) = of(run(wire), "follower_1/joint_states")
    positions, velocities = conversions.read_joint_states(answer)
    assert not any(positions)
    assert not any(velocities)
    (text,) = wire.warnings
    assert text.startswith("follower_1: ")
    assert text.endswith("; nothing moves")
    assert world_of(wire).ground_truth("follower_1") == before
    assert wire.component.health().level == 1


def test_a_bad_command_does_not_disturb_a_motion_under_way(wire: Wire) -> None:
    other = wired("world", "", surface="plane", camera={"mode": "on_demand"}, seed=3)
    other.component.start()
    for either in (wire, other):
        either.give(COMMANDS, command())
        either.component.work()
    wire.give(COMMANDS, nan_at(1, "angles"))
    ends = [of(run(either), "follower_1/joint_states")[-1].position for either in (wire, other)]
    assert ends[0] == ends[1]
    world_of(other).close()


def test_as_many_frames_come_as_were_asked_for_each_later_than_the_one_before(wire: Wire) -> None:
    wire.give(REQUEST, conversions.uint32(3))
    pictures = of(run(wire), IMAGE)
    assert len(pictures) == 3
    stamps = [conversions.stamp_of(message) for message in pictures]
    assert stamps == sorted(set(stamps))
    assert stamps[0] > 0
    assert conversions.read_image(pictures[0]).shape == (208, 316, 3)
    assert pictures[0].header.frame_id == "follower_1/camera_optical_frame"


@pytest.mark.parametrize("count", [0, 601, 2**32 - 1])
def test_a_request_for_no_or_too_many_frames_warns_and_gives_none(wire: Wire, count: int) -> None:
    wire.give(REQUEST, conversions.uint32(count))
    assert not wire.component.busy
    assert len(wire.warnings) == 1


def test_the_leader_has_no_camera(wire: Wire) -> None:
    assert "leader/camera/request" not in wire.inputs


def test_a_robot_that_takes_too_long_is_warned_of() -> None:
    wire = wired("world", "", surface="plane", motion_timeout_s=0.1, camera={"mode": "on_demand"})
    wire.component.start()
    wire.give(COMMANDS, command((50.0,) * 4))
    run(wire)
    assert "took too long" in wire.warnings[0]
    world_of(wire).close()


@pytest.mark.parametrize("values", [{"robots": ["leader", "leader"]}, {"robots": ["leader"]}, {"start_x_m": [0.1]}])
def test_robots_need_different_names_and_a_start_each(values: dict[str, list[float | str]]) -> None:
    with pytest.raises(ParameterError, match="'robots' must differ and have one"):
        wired("world", "", **values)


def test_surface_parameters_are_names_and_numbers() -> None:
    assert surface_from_texts("plane", ("height_m=0.1",)).height(0.5, 0.5) == 0.1
    for bad in ("height_m", "height_m=", "height_m=high"):
        with pytest.raises(ParameterError, match="plane"):
            surface_from_texts("plane", (bad,))


def test_an_unknown_surface_is_refused_with_the_near_name() -> None:
    with pytest.raises(ParameterError, match="did you mean 'bowl'"):
        wired("world", "", surface="bowll")


@pytest.mark.parametrize("name", ["plane", "bowl"])
def test_the_mesh_covers_the_plate_once_at_the_surfaces_heights_and_faces_up(name: str) -> None:
    surface = make_surface(name)
    vertices, colours, triangles = surface_mesh(surface)
    for x, y, z in vertices[::97]:
        assert z == pytest.approx(surface.height(x, y), abs=1e-12)
    assert ((colours >= 0.0) & (colours <= 1.0)).all()
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    doubled = np.cross(b - a, c - a)[:, 2]
    assert (doubled > 0.0).all()
    assert doubled.sum() / 2 == pytest.approx(surface.size_m**2)
