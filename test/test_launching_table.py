"""Our launcher and launch/formation.launch.py start the same nodes with the same parameters."""

import importlib.util
import sys
import types
from pathlib import Path

import pytest

from robot_formation.experiment import scenario as scenarios
from robot_formation.launching.processes import processes
from robot_formation.paths import share_dir


class Recorded:
    """Stands in for the launch actions: keeps what it was made with."""

    def __init__(self, *arguments, **options):
        self.arguments, self.options = arguments, options

    def perform(self, context):
        return context[self.arguments[0]]


@pytest.fixture
def launch_file(monkeypatch):
    """The launch file's module, with stand-ins for launch where no ROS install has it."""
    names = {
        "launch": ["LaunchContext", "LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "OpaqueFunction", "SetEnvironmentVariable", "Shutdown"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
    }
    for name, members in names.items():
        module = types.ModuleType(name)
        for member in members:
            setattr(module, member, type(member, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    path = share_dir() / "launch" / "formation.launch.py"
    spec = importlib.util.spec_from_file_location("formation_launch", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def launched(launch_file, **arguments):
    """What the launch file starts: executable, namespace and parameters of each node."""
    context = {name: default for name, (default, _) in launch_file.ARGUMENTS.items()} | arguments
    return [
        (node.options["executable"], node.options["namespace"], node.options["parameters"][0])
        for node in launch_file.nodes(context)
    ]


def test_both_start_the_same_nodes(launch_file, tmp_path):
    bag = tmp_path / "bag"
    scenario = scenarios.override(
        scenarios.load_track("one"), ["seed=3", "predictor.name=literal", "predictor.forgetting=0.9", "followers=2"]
    )
    ours = [(p.executable, p.namespace, p.ros_parameters()) for p in processes(scenario, bag)]
    theirs = launched(
        launch_file,
        track="one",
        seed="3",
        predictor="literal",
        set="predictor.forgetting=0.9 followers=2",
        bag=str(bag),
    )
    assert theirs == ours
    assert [(executable, namespace) for executable, namespace, _ in ours] == [
        ("recorder", "/"),
        ("world", "/"),
        ("overhead_tracker", "/"),
        ("drive", "/leader"),
        ("drive", "/follower_1"),
        ("drive", "/follower_2"),
        ("block_detector", "/follower_1"),
        ("block_detector", "/follower_2"),
        ("predictor", "/follower_1"),
        ("predictor", "/follower_2"),
        ("fine_tuner", "/follower_1"),
        ("fine_tuner", "/follower_2"),
        ("leader", "/leader"),
    ]


def test_a_launch_without_bag_has_no_recorder_and_waits_for_none(launch_file):
    nodes = launched(launch_file)
    assert "recorder" not in {executable for executable, _, _ in nodes}
    assert {parameters["recorder"] for _, _, parameters in nodes} == {""}


def test_a_scenario_file_and_a_surface_are_taken(launch_file, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("leader: {timesteps: 7}")
    found = launched(launch_file, scenario=str(file), surface="plane")
    nodes = {executable: parameters for executable, _, parameters in found}
    assert nodes["leader"]["timesteps"] == 7
    assert nodes["world"]["surface"] == "plane"


def test_rviz_is_started_beside_the_nodes_and_does_not_end_the_run(launch_file):
    def started(**arguments):
        defaults = {name: default for name, (default, _) in launch_file.ARGUMENTS.items()}
        return [node.options for node in launch_file.nodes({**defaults, **arguments})]

    (viewer,) = started(rviz="true")[len(started()) :]
    assert viewer["package"] == viewer["executable"] == "rviz2"
    assert Path(viewer["arguments"][1]).is_file()
    assert "on_exit" not in viewer
    assert all("on_exit" in options for options in started())


def test_every_launch_argument_is_declared_and_discovery_stays_here(launch_file):
    (actions,) = launch_file.generate_launch_description().arguments
    declared = [action.arguments[0] for action in actions if type(action).__name__ == "DeclareLaunchArgument"]
    assert declared == list(launch_file.ARGUMENTS)
    (variable,) = [action for action in actions if type(action).__name__ == "SetEnvironmentVariable"]
    assert variable.arguments[0] == "ROS_AUTOMATIC_DISCOVERY_RANGE"
    assert launch_file.ARGUMENTS["discovery_range"][0] == "LOCALHOST"


def test_parameters_survive_the_way_through_a_ros_parameter_file(tmp_path):
    import yaml

    for process in processes(scenarios.load_track("two"), Path("bag")):
        text = yaml.safe_dump({"/**": {"ros__parameters": process.ros_parameters()}})
        assert yaml.safe_load(text)["/**"]["ros__parameters"] == process.ros_parameters()


def test_without_the_overhead_camera_its_tracker_is_not_started():
    scenario = scenarios.override(scenarios.load_track("two"), ["world.overhead.enabled=false"])
    assert "overhead_tracker" not in {process.executable for process in processes(scenario, None)}
