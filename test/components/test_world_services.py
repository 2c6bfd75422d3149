"""The world component: reset, pause, step, refused commands, and the end of a run at the plate's edge."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from sensor_msgs.msg import JointState

from robot_formation import conversions, names
from robot_formation.components.base import Place
from robot_formation.components.block_detector import BlockDetectorComponent
from robot_formation.components.drive import DriveComponent
from robot_formation.components.node_parameters import BlockDetectorNodeParameters, WorldNodeParameters
from robot_formation.components.world import WorldComponent
from robot_formation.drive.movement_system import DriveParameters, WheelCommand
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import run_in_process
from robot_formation.geometry.se2 import Motion
from robot_formation.names import WHEELS
from robot_formation.parameters import ParameterError, from_mapping
from robot_formation.surface import SURFACES

pytestmark = pytest.mark.slow

STRAIGHT = conversions.joint_command(WheelCommand((1.6,) * 4, (4.0,) * 4), 0)


def parameters(**values: Any) -> WorldNodeParameters:
    return from_mapping(WorldNodeParameters, {"camera": {"mode": "on_demand"}, **values}, where="test")


class Hosted:
    """A world component with what it sent and said."""

    def __init__(self, **values: Any) -> None:
        self.component = WorldComponent(parameters(**values), Place(""))
        self.sent: list[tuple[str, Any]] = []
        self.said: list[str] = []
        self.component.attach(
            lambda topic, message: self.sent.append((topic.name, conversions.as_message(message, topic.type))),
            lambda level, text: self.said.append(text),
        )
        self.component.start()

    def give(self, topic: str, message: Any) -> None:
        (handler,) = [entry.handler for entry in self.component.inputs() if entry.topic.name == topic]
        handler(message)

    def run(self) -> None:
        while self.component.busy:
            self.component.work()

    def stranger(self) -> None:
        """What a stranger does to the world: drives both robots and looks."""
        for robot in ("leader", "follower_1"):
            self.give(f"{robot}/joint_commands", STRAIGHT)
            self.give("follower_1/camera/request", conversions.uint32(2))
            self.run()

    def of(self, topic: str) -> list[Any]:
        return [message for name, message in self.sent if name == topic]

    def call(self, service: str) -> tuple[bool, str]:
        return self.component.services()[service]()

    def pause(self, value: bool) -> Any:
        return self.component.switches()["world/pause"](value)


def facts(sent: Sequence[tuple[str, Any]], start_ns: int) -> list[Any]:
    """Stamped messages, with stamps counted from the world's start, to the last bit."""
    found = []
    for name, message in sent:
        if hasattr(message, "header") and hasattr(message.header, "stamp") and not hasattr(message, "poses"):
            stamp = conversions.to_ns(message.header.stamp)
            message.header.stamp = conversions.to_time(0)
            found.append((name, stamp - start_ns if stamp else 0, message))
    return found


def test_a_reset_world_gives_the_same_run_as_a_fresh_one_at_later_stamps() -> None:
    fresh = Hosted(seed=4)
    fresh.stranger()
    used = Hosted(seed=4)
    used.stranger()
    used.give("leader/joint_commands", STRAIGHT)
    used.component.work()
    before = used.component.stamp_ns
    used.sent.clear()
    done, text = used.call("world/reset")
    assert done
    assert text.startswith(f"seed 4, from {before // 10**9 + 1} s on; a run that was under way waits for ever: start")
    assert not used.component.busy
    start = used.component.stamp_ns
    assert start > before
    assert start % 10**9 == 0
    answer = [name for name, _ in used.sent]
    assert answer[-2:] == ["leader/joint_states", "follower_1/joint_states"]
    del used.sent[-2:]
    used.stranger()
    assert answer[:-2] == [name for name, _ in fresh.sent][: len(answer) - 2]
    assert facts(used.sent, start) == facts(fresh.sent, 0)


def test_a_reset_says_again_what_a_late_joiner_needs_and_time_never_goes_back() -> None:
    used = Hosted()
    used.stranger()
    used.call("world/reset")
    for topic in (
        "surface",
        "follower_1/camera/camera_info",
        "leader/robot_description",
        "follower_1/robot_description",
    ):
        assert len(used.of(topic)) == 2
    assert len(used.of("ground_truth/leader/path")[-1].poses) == 1
    used.stranger()
    clock = [conversions.to_ns(message.clock) for message in used.of("clock")]
    assert clock == sorted(clock)


def test_a_reset_before_anything_moved_asks_for_nothing() -> None:
    assert Hosted(seed=4).call("world/reset") == (True, "seed 4, from 1 s on")


def test_drives_and_detectors_need_no_restart_after_a_reset() -> None:
    def moved(resets: int) -> Any:
        world = Hosted(seed=4, robots=["leader"], start_x_m=[0.7], start_y_m=[0.4], start_heading_rad=[1.0])
        drive, results = DriveComponent(DriveParameters(), Place("leader")), []
        drive.attach(
            lambda topic, message: (
                world.give("leader/joint_commands", message)
                if topic.name == "joint_commands"
                else results.append((topic.name, message))
            ),
            lambda level, text: None,
        )
        move, joints = (entry.handler for entry in drive.inputs())

        def drive_once() -> None:
            move(conversions.move(Motion(x_m=0.05), "leader/base_link", world.component.stamp_ns))
            while world.component.busy:
                done = len(world.sent)
                world.component.work()
                for name, message in world.sent[done:]:
                    if name == "leader/joint_states":
                        joints(message)

        for _ in range(resets):
            drive_once()
            done = len(world.sent)
            world.call("world/reset")
            for name, message in world.sent[done:]:
                if name == "leader/joint_states":
                    joints(message)
        drive_once()
        return [conversions.read_displacement(message) for name, message in results if name == "moved"][-1]

    assert moved(2) == moved(0)
    world = Hosted()
    detector = BlockDetectorComponent(BlockDetectorNodeParameters(), Place("follower_1"))
    blocks = []
    detector.attach(lambda topic, message: blocks.append(message), lambda level, text: None)
    for _ in range(2):
        world.stranger()
        world.call("world/reset")
    for image in world.of("follower_1/camera/image_raw"):
        detector.inputs()[0].handler(image)
    assert len(blocks) == 8
    assert detector.health().level == 0


def test_a_reset_takes_seed_surface_and_starts_that_were_set_before() -> None:
    used = Hosted(seed=1)
    used.component.set_parameters(
        parameters(seed=2, surface="ripple", start_x_m=[0.6, 0.92], start_y_m=[0.5, 0.5], camera={"mode": "stream"})
    )
    used.sent.clear()
    used.call("world/reset")
    assert used.of("ground_truth/leader/pose")[0].pose.position.x == pytest.approx(0.6, abs=1e-3)
    fresh = Hosted(seed=2, surface="ripple", start_x_m=[0.6, 0.92], start_y_m=[0.5, 0.5], camera={"mode": "stream"})
    assert used.of("surface") == fresh.of("surface")


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"surface": "bowel"}, "did you mean 'bowl'"),
        ({"start_x_m": [0.5, 3.0]}, "beyond the plate"),
    ],
)
def test_parameters_that_no_reset_could_take_are_refused_at_once(values: Any, says: str) -> None:
    used = Hosted()
    with pytest.raises(ValueError, match=says):
        used.component.set_parameters(parameters(**values))
    assert used.call("world/reset")[0]


def test_a_reset_that_cannot_be_leaves_the_world_as_it_is() -> None:
    used = Hosted()
    used.stranger()
    used.component.set_parameters(parameters(start_x_m=[0.7, 0.75]))
    before, sent = used.component.stamp_ns, len(used.sent)
    done, text = used.call("world/reset")
    assert not done
    assert "overlap" in text
    assert "nothing was reset" in text
    assert (used.component.stamp_ns, len(used.sent)) == (before, sent)
    used.stranger()
    assert used.component.stamp_ns > before


def test_a_paused_world_stands_still_and_steps_on_request_without_changing_the_run() -> None:
    free, paused = Hosted(seed=4), Hosted(seed=4)
    free.stranger()
    assert paused.call("world/step") == (False, "the world runs: call world/pause with true first")
    assert paused.pause(True) == (True, "paused")
    assert not paused.call("world/step")[0]
    paused.give("leader/joint_commands", STRAIGHT)
    paused.give("follower_1/camera/request", conversions.uint32(2))
    assert not paused.component.busy
    for _ in range(30):
        assert paused.call("world/step")[0]
    assert paused.component.stamp_ns == 30 * 10**9 // 240
    assert paused.component.details()["paused"] == "True"
    paused.pause(False)
    paused.run()
    paused.give("follower_1/joint_commands", STRAIGHT)
    paused.give("follower_1/camera/request", conversions.uint32(2))
    paused.run()
    assert facts(paused.sent, 0) == facts(free.sent, 0)


def command(
    joints: Sequence[str] = WHEELS, angles: Sequence[float] = (1.0,) * 4, speeds: Sequence[float] = (4.0,) * 4
) -> Any:
    return JointState(name=list(joints), position=list(angles), velocity=list(speeds))


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (command(angles=(math.nan, 1.0, 1.0, 1.0)), "finite"),
        (command(speeds=(4.0, 4.0, math.nan, 4.0)), "finite"),
        (command(angles=(1.0, -math.inf, 1.0, 1.0)), "finite"),
        (command(joints=("front_left_wheel", "front_right_wheel", "rear_left_wheel", "wheel")), "must name"),
        (command(joints=(*WHEELS[:3], WHEELS[0])), "once each"),
        (command(joints=WHEELS[:3], angles=(1.0,) * 3, speeds=(4.0,) * 3), "must name"),
        (command(angles=(1.0,) * 3), "4 positions"),
        (command(speeds=()), "4 velocities"),
        (command(speeds=(1e6,) * 4), "at most 12 rad/s"),
        (command(speeds=(-4.0,) * 4), "more than 0"),
        (command(speeds=(0.0,) * 4), "more than 0"),
        (command(angles=(500.0,) * 4), "split it"),
        (command(angles=(1e30,) * 4), "absurd"),
        (JointState(), "must name"),
    ],
)
def test_a_bad_command_is_refused_with_a_diagnostic_and_moves_nothing(message: Any, says: str) -> None:
    used = Hosted()
    before = used.component._world.ground_truth("leader")
    used.give("leader/joint_commands", message)
    used.run()
    assert used.component._world.ground_truth("leader") == before
    health = used.component.health()
    assert (health.level, health.values["warnings"]) == (1, "1")
    assert says in health.text
    assert "nothing moves" in health.text


def test_a_robot_that_leaves_the_plate_ends_the_run_with_code_3_and_a_reason() -> None:
    used = Hosted(start_y_m=[1.7, 0.5])
    used.give("leader/joint_commands", conversions.joint_command(WheelCommand((8.0,) * 4, (4.0,) * 4), 0))
    while used.component.busy and used.component.exit_code is None:
        used.component.work()
    assert used.component.exit_code == 3
    assert re.fullmatch(
        r"leader has left the plate at \(0.7\d, 1.7\d\) m and is held there", used.component.exit_reason
    )
    assert used.component.health().level == 1
    assert [message.data for message in used.of(names.left_plate().name)] == ["leader"]


def test_a_run_can_go_on_with_a_robot_beyond_the_plate_until_a_reset() -> None:
    used = Hosted(start_y_m=[1.7, 0.5], leaving_ends_run=False)
    for _ in range(2):
        used.give("leader/joint_commands", conversions.joint_command(WheelCommand((8.0,) * 4, (4.0,) * 4), 0))
        used.run()
        assert used.component.exit_code is None
        used.give("leader/joint_commands", STRAIGHT)
        assert "has left the plate" in used.component.health().text
        assert not used.component.busy
        used.call("world/reset")
    assert len(used.of(names.left_plate().name)) == 2


def short(*settings: str, track: str = "one") -> Any:
    return scenarios.override(
        scenarios.load_track(track), ["seed=3", "leader.timesteps=2", "world.camera.mode=on_demand", *settings]
    )


@pytest.mark.parametrize("surface", sorted(SURFACES))
@pytest.mark.parametrize("track", ["one", "two"])
def test_a_run_on_every_surface_ends_done_or_lost(surface: str, track: str) -> None:
    scenario = scenarios.with_surface(short(track=track), surface)
    scenario.check()
    assert run_in_process(scenario, None, {}).exit_code in (0, 3)


def test_a_run_ends_with_3_when_the_leader_drives_off_the_plate() -> None:
    result = run_in_process(short("start_y_m=1.7", "leader.timesteps=5"), None, {})
    assert result.exit_code == 3
    assert "leader has left the plate" in result.reason


@pytest.mark.parametrize(("track", "followers", "fits"), [("one", 2, True), ("one", 3, False), ("two", 2, False)])
def test_followers_that_would_start_beyond_the_plate_are_refused_before_anything_starts(
    track: str, followers: int, fits: bool
) -> None:
    scenario = short(f"followers={followers}", track=track)
    if fits:
        scenario.check()
        return
    with pytest.raises(ValueError, match=rf"follower_{followers}'? (can't start|would stand).*take fewer followers"):
        scenario.check()


def test_a_height_map_can_be_named_in_a_scenario(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"nowhere.npy: can't read it"):
        short("world.surface=heightmap", f"world.surface_parameters=['file={tmp_path}/nowhere.npy']").check()
