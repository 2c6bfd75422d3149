"""Start a run's nodes on a ROS 2 install, with the arguments below: ros2 launch robot_formation formation.launch.py.

The nodes come from the same table as those of `formation run` (robot_formation/launching/processes.py).
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from robot_formation.experiment import scenario as scenarios
from robot_formation.launching.processes import processes
from robot_formation.paths import config_dir

ARGUMENTS = {
    "track": ("two", "preset track: see 'formation list tracks'"),
    "scenario": ("", "scenario file, instead of a track"),
    "surface": ("", "surface: see 'formation list surfaces'; empty: the scenario's"),
    "predictor": ("", "predictor: see 'formation list predictors'; empty: the scenario's"),
    "seed": ("", "seed of every random stream; empty: the scenario's"),
    "camera": ("", "stream or on_demand; empty: the scenario's"),
    "real_time_factor": ("", "0: as fast as possible, 1: real time; empty: the scenario's"),
    "set": ("", "further settings, separated by spaces, like 'predictor.forgetting=0.95 followers=2'"),
    "bag": ("", "folder of the bag, which must not exist; empty: nothing is recorded"),
    "images": ("false", "record pictures too"),
    "rviz": ("false", "show the run in RViz, where rviz2 is installed; closing it doesn't end the run"),
    "discovery_range": ("LOCALHOST", "who may find the nodes: LOCALHOST, SUBNET, OFF or SYSTEM_DEFAULT"),
}


def nodes(context: LaunchContext) -> list[Node]:
    """List the nodes of the scenario that the arguments describe; the end of any of them ends the launch."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    file = value["scenario"]
    scenario = scenarios.load(Path(file)) if file else scenarios.load_track(value["track"])
    if value["surface"]:
        scenario = scenarios.with_surface(scenario, value["surface"])
    settings = {
        "predictor.name": value["predictor"],
        "seed": value["seed"],
        "world.camera.mode": value["camera"],
        "world.real_time_factor": value["real_time_factor"],
    }
    named = [f"{key}={text}" for key, text in settings.items() if text]
    scenario = scenarios.override(scenario, [*named, *value["set"].split()])
    scenario.check()
    bag = Path(value["bag"]).absolute() if value["bag"] else None
    started = [
        Node(
            package="robot_formation",
            executable=process.executable,
            namespace=process.namespace,
            parameters=[process.ros_parameters()],
            output="screen",
            on_exit=Shutdown(reason=f"{process.name} has ended"),
        )
        for process in processes(scenario, bag, images=is_true(value["images"]))
    ]
    return [*started, rviz()] if is_true(value["rviz"]) else started


def is_true(text: str) -> bool:
    """Read a switch as other launch files do."""
    return text.lower() in ("true", "1")


def rviz() -> Node:
    """Make the viewer, with the displays of a formation."""
    return Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(config_dir() / "formation.rviz")],
        parameters=[{"use_sim_time": True}],
    )


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, keep discovery on this machine unless told otherwise, and start the nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value=d, description=text) for name, (d, text) in ARGUMENTS.items()
    ]
    discovery = SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", LaunchConfiguration("discovery_range"))
    return LaunchDescription([*arguments, discovery, OpaqueFunction(function=nodes)])
