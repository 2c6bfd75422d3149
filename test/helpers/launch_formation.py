"""A launch test of launch/formation.launch.py: the nodes start, and Ctrl-C ends them in good order.

test/launching/test_launch_file.py runs it where launch_testing is installed. By hand:
`launch_test test/helpers/launch_formation.py`.
"""

import os
import time
import unittest
from typing import Any

import launch_testing.actions
import launch_testing.asserts
import rclpy
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from launch import LaunchDescription
from robot_formation.experiment.scenario import load_track
from robot_formation.launching.processes import processes
from robot_formation.network.loopback import use_loopback
from robot_formation.paths import share_dir

FILE = share_dir() / "launch" / "formation.launch.py"
# Slow motion: the run goes on until launch is told to end.
ARGUMENTS = {"track": "one", "camera": "on_demand", "real_time_factor": "0.1"}
DEADLINE_S = 60.0


def generate_test_description() -> LaunchDescription:
    run = IncludeLaunchDescription(PythonLaunchDescriptionSource(str(FILE)), launch_arguments=ARGUMENTS.items())
    return LaunchDescription([run, launch_testing.actions.ReadyToTest()])


class WhileItRuns(unittest.TestCase):
    def setUp(self) -> None:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"  # as the launch file's default
        use_loopback(os.environ)  # as its nodes
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("_witness", context=self.context)

    def tearDown(self) -> None:
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def test_every_node_appears(self) -> None:
        executor = SingleThreadedExecutor(context=self.context)
        expected = {(process.executable, process.namespace) for process in processes(load_track("one"), None)}
        end = time.monotonic() + DEADLINE_S
        while missing := expected - set(self.node.get_node_names_and_namespaces()):
            assert time.monotonic() < end, f"not started: {missing}"
            rclpy.spin_once(self.node, executor=executor, timeout_sec=0.1)


@launch_testing.post_shutdown_test()
class AfterTheEnd(unittest.TestCase):
    def test_every_node_ended_cleanly(self, proc_info: Any) -> None:
        launch_testing.asserts.assertExitCodes(proc_info)
