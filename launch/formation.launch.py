"""Start a run's nodes on a ROS 2 install, with the arguments below: ros2 launch robot_formation formation.launch.py.

The nodes come from the same table as those of `formation run` (robot_formation/launching/processes.py). Their names are
relative: they lie below the namespace that is pushed where this file is included.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch.actions import DeclareLaunchArgument, EmitEvent, LogInfo, OpaqueFunction
from launch.events import Shutdown, matches_action
from launch.events.process import ShutdownProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from robot_formation import names
from robot_formation.bag.bag_path import check_free
from robot_formation.errors import FormationError
from robot_formation.launching.arguments import (
    ARGUMENTS,
    discovery,
    is_true,
    left_out,
    rviz_config,
    rviz_remappings,
    scenario_of,
    viewer_environment,
)
from robot_formation.launching.launcher import RECORDER_PATIENCE_S
from robot_formation.launching.outcome import LaunchedRun
from robot_formation.launching.processes import Process, processes, progress

PACKAGE = "robot_formation"
RUNS = "robot_formation_runs"


def nodes(context: LaunchContext) -> list[Node]:
    """List the nodes of the scenario that the arguments describe; whatever is wrong is said before any is started."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    scenario = scenario_of(value)
    bag = Path(value["bag"]).absolute() if value["bag"] else None
    stand_ins, timeout_s = left_out(value, scenario)
    if bag is not None:
        check_free(bag)
    viewer = is_true(value["rviz"])
    if viewer:
        check_viewer()
    environment = discovery(value["discovery_range"], context.environment)
    namespace = value["namespace"]
    images = is_true(value["images"])
    whole = processes(scenario, bag, images=images, namespace=namespace, stand_ins=stand_ins)
    table = [process for process in whole if not process.stand_in]
    table.append(progress(scenario, namespace, stand_ins, timeout_s))
    run = LaunchedRun(len(table), str(bag or ""))
    started: list[Node] = []
    started += [node(process, environment, on_exit(run, process, started)) for process in table]
    if viewer:
        pushed = names.absolute("", context.launch_configurations.get("ros_namespace", ""))
        seeing = viewer_environment(environment, context.environment)
        started.append(rviz(names.absolute(pushed, namespace), seeing))
    context.extend_globals({RUNS: [*runs(context), run]})
    return started


def check_viewer() -> None:
    """Refuse to start without a viewer that is asked for: nodes that ran already would be left alone."""
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        raise FormationError("rviz:=true needs the package rviz2, which is not installed; leave it out") from None


def runs(context: LaunchContext) -> list[LaunchedRun]:
    """List the runs that were launched together."""
    found: list[LaunchedRun] = getattr(context.locals, RUNS, [])
    return found


def node(process: Process, environment: dict[str, str], ended: Callable[..., Any]) -> Node:
    """Make the action that starts a process of the table; as long as the recorder may take, so may all."""
    sigterm_s, sigkill_s = map(str, RECORDER_PATIENCE_S)
    return Node(
        package=PACKAGE,
        executable=process.executable,
        namespace=process.namespace,
        parameters=[process.ros_parameters()],
        additional_env=environment,
        output="screen",
        on_exit=ended,
        sigterm_timeout=sigterm_s,
        sigkill_timeout=sigkill_s,
    )


def on_exit(run: LaunchedRun, process: Process, nodes: list[Node]) -> Callable[..., Any]:
    """Make the handler of a process's end: the first end ends the run's other nodes, the last one says how it went."""

    def handle(event: Any, context: LaunchContext) -> list[Any]:
        if run.ended(process.name, process.executable, event.returncode, stopping=context.is_shutdown):
            return [EmitEvent(event=ShutdownProcess(process_matcher=matches_action(other))) for other in nodes]
        return conclusion(run, runs(context)) if run.complete else []

    return handle


def conclusion(run: LaunchedRun, together: list[LaunchedRun]) -> list[Any]:
    """Say how a run has ended; the launch ends with the last of those that were launched together."""
    if not all(other.complete for other in together):
        return [LogInfo(msg=str(run))]
    said = [] if run.failed else [LogInfo(msg=str(run))]
    failed = "; ".join(str(other) for other in together if other.failed)
    if failed:  # an exception is what makes launch end with exit code 1; here it leaves nobody behind
        return [*said, OpaqueFunction(function=fail, args=[failed])]
    return [*said, EmitEvent(event=Shutdown(reason="the run has ended"))]


def fail(context: LaunchContext, text: str) -> None:
    """Make the launch fail."""
    raise FormationError(text)


def rviz(namespace: str, environment: dict[str, str]) -> Node:
    """Make the viewer, with the displays of a formation."""
    return Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(rviz_config())],
        parameters=[{"use_sim_time": True}],
        remappings=rviz_remappings(namespace),
        additional_env=environment,
    )


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the nodes."""
    declared = [
        DeclareLaunchArgument(
            name,
            default_value=argument.default,
            description=argument.description,
            choices=list(argument.choices) if argument.choices else None,
        )
        for name, argument in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
