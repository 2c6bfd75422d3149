"""The world's services over the live graph: strangers pause, step and reset it; a lost plate ends a run."""

from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from graph_lab import Lab
from graph_tools import launch, short_scenario
from robot_formation import conversions, names
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.drive.movement_system import WheelCommand

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("world_services")]


class Stranger:
    """Somebody who drives the leader of a world of his own."""

    def __init__(self, lab: Lab) -> None:
        self._lab = lab
        arguments = ("-p", "camera.mode:=on_demand", "-p", "seed:=4", "-p", "wait_for_listeners_s:=0.0")
        lab.start("world", *arguments)
        self.states = lab.collect(names.joint_states("leader"))
        self.poses = lab.collect(names.ground_truth_pose("leader"))
        self._commands = lab.publisher(names.joint_commands("leader"))
        lab.until(lambda: len(self.poses) == 1)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self._lab.node.create_client(kind, name)
        self._lab.until(client.service_is_ready)
        future = client.call_async(request)
        self._lab.until(future.done)
        return future.result()

    def command(self) -> None:
        self._commands.publish(conversions.joint_command(WheelCommand((1.6,) * 4, (4.0,) * 4), 0))

    def drive(self) -> tuple[list[float], Any]:
        """One motion: what the encoders and ground truth say at its end, without stamps."""
        poses, states = len(self.poses), len(self.states)
        self.command()
        self._lab.until(lambda: len(self.poses) > poses and len(self.states) > states and self.at_rest())
        return list(self.states[-1].position), self.poses[-1].pose

    def at_rest(self) -> bool:
        return not any(self.states[-1].velocity)

    def reset(self) -> Any:
        poses = len(self.poses)
        answer = self.call(Trigger, "/world/reset", Trigger.Request())
        if answer.success:
            self._lab.until(lambda: len(self.poses) > poses and self.at_rest())
        return answer

    def set(self, **values: Any) -> Any:
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        (result, *_) = self.call(
            SetParameters, "/world/set_parameters", SetParameters.Request(parameters=parameters)
        ).results
        return result


def test_strangers_reset_a_world_and_get_the_same_run_again(lab: Lab) -> None:
    stranger = Stranger(lab)
    first = [stranger.drive(), stranger.drive()]
    stamps = [conversions.stamp_of(message) for message in stranger.states]
    assert stranger.reset().success
    assert [stranger.drive(), stranger.drive()] == first
    later = [conversions.stamp_of(message) for message in stranger.states][len(stamps) :]
    assert min(later) > max(stamps)
    assert stranger.set(seed=5, surface="plane").successful
    assert stranger.reset().message.startswith("seed 5")
    assert stranger.drive() != first[0]


def test_parameters_are_checked_when_they_are_set(lab: Lab) -> None:
    stranger = Stranger(lab)
    for name, value, says in (
        ("surface", "bowel", "did you mean 'bowl'"),
        ("robots", ["leader"], "it decides on topics"),
        ("start_x_m", [0.5], "start_x_m"),
        ("surfase", "bowl", "did you mean 'surface'"),
        ("start_x_m", [5.0, 0.5], "beyond the plate"),
        ("wait_for_listeners_s", 1.0, "used while the node starts"),
    ):
        result = stranger.set(**{name: value})
        assert not result.successful
        assert says in result.reason
    assert stranger.set(real_time_factor=50.0).successful
    stranger.drive()


def test_a_paused_world_steps_on_request(lab: Lab) -> None:
    stranger = Stranger(lab)
    assert not stranger.call(Trigger, "/world/step", Trigger.Request()).success
    assert stranger.call(SetBool, "/world/pause", SetBool.Request(data=True)).message == "paused"
    stranger.command()
    answers: list[Any] = []

    def stepped() -> bool:
        answers.append(stranger.call(Trigger, "/world/step", Trigger.Request()))
        return bool(answers[-1].success)

    # The command is on its way; until it is there, nothing is owed.
    lab.until(stepped)
    assert answers[-1].message == "0.004167 s"
    assert stranger.call(Trigger, "/world/step", Trigger.Request()).message == "0.008333 s"
    assert stranger.states == []
    assert stranger.call(SetBool, "/world/pause", SetBool.Request(data=False)).message == "running"
    lab.until(lambda: len(stranger.poses) == 2)


def test_a_run_whose_leader_leaves_the_plate_ends_with_3_a_reason_and_a_whole_bag(tmp_path: Path) -> None:
    scenario = short_scenario("leader.timesteps=6", "start_y_m=1.66", track="one")
    result = launch(scenario, tmp_path / "bag")
    assert result.exit_code == 3
    assert result.reason.startswith("leader has left the plate at (")
    analysis = analyse(load_run(tmp_path / "bag"))
    assert analysis.outcome == "left_plate"
    assert len(analysis.followers[0].timesteps) >= 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag"]
