"""The package's executables (`ros2 run robot_formation NAME`), one function each.

What a node does is in components/, and for recorder, player, progress and viewer in the folders here.
"""

from __future__ import annotations

from functools import partial

from robot_formation.nodes.host.signals import stop_on_signals


def _component(kind: str) -> int:
    stop_on_signals()  # before ROS is imported, which takes a second
    from robot_formation.nodes.host.component_node import main_of

    return main_of(kind)


world = partial(_component, "world")
overhead_tracker = partial(_component, "overhead_tracker")
drive = partial(_component, "drive")
block_detector = partial(_component, "block_detector")
predictor = partial(_component, "predictor")
fine_tuner = partial(_component, "fine_tuner")
leader = partial(_component, "leader")


def recorder() -> int:
    """Run the recorder until it ends."""
    stop_on_signals()
    from robot_formation.nodes.host.component_node import run_node
    from robot_formation.nodes.recorder.recorder_node import RecorderExecutable

    return run_node("recorder", RecorderExecutable)


def player() -> int:
    """Run the player until it ends."""
    stop_on_signals()
    from robot_formation.nodes.host.component_node import run_node
    from robot_formation.nodes.player.player_node import PlayerExecutable

    return run_node("player", PlayerExecutable)


def progress() -> int:
    """Run the progress node until it ends."""
    stop_on_signals()
    from robot_formation.nodes.host.component_node import run_node
    from robot_formation.nodes.progress.progress_node import ProgressExecutable

    return run_node("progress", ProgressExecutable)


def viewer() -> int:
    """Run the viewer until it ends."""
    stop_on_signals()
    from robot_formation.nodes.host.component_node import run_node
    from robot_formation.nodes.viewer.viewer_node import ViewerExecutable

    return run_node("viewer", ViewerExecutable)
