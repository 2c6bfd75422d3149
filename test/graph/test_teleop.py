"""A leader driven over topics in the live graph, its replay, and turns with a blackout in graph and process."""

import threading
from pathlib import Path

import pytest
import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from graph_tools import displacements, formation, launch, short_scenario
from robot_formation.analysis.from_bag import load_run
from robot_formation.experiment.in_process import run_in_process

pytestmark = [pytest.mark.graph, pytest.mark.long, pytest.mark.xdist_group("teleop")]

CIRCLE = ("heading_deg=90", "leader.path=circle", "leader.path_parameters=[heading=along, radius_m=0.6]")


class Person:
    """Holds a key down: sends changing velocities on both topics until the run has ended."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._monkeypatch = monkeypatch
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def started(self, domain: int, pids: dict[str, int]) -> None:
        self._monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        self._thread = threading.Thread(target=self._drive, args=(domain,))
        self._thread.start()

    def _drive(self, domain: int) -> None:
        context = Context()
        rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        node = Node("_person", context=context, enable_rosout=False, start_parameter_services=False)
        stamped = node.create_publisher(TwistStamped, "/leader/cmd_vel", 1)
        bare = node.create_publisher(Twist, "/leader/cmd_vel_unstamped", 1)
        sent = 0
        while not self._stop.wait(0.05):
            twist = Twist()
            twist.linear.x, twist.linear.y, twist.angular.z = 0.03 + 0.0001 * (sent % 97), 0.01, 0.02
            if sent % 2:
                bare.publish(twist)
            else:
                stamped.publish(TwistStamped(twist=twist))
            sent += 1
        node.destroy_node()
        rclpy.shutdown(context=context)

    def finish(self) -> None:
        self._stop.set()
        assert self._thread is not None
        self._thread.join()


def test_what_a_person_has_driven_replays_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    person = Person(monkeypatch)
    driven = short_scenario("heading_deg=90", "leader.path=teleop")
    result = launch(driven, tmp_path / "driven", on_start=person.started)
    person.finish()
    assert (result.exit_code, result.reason) == (0, "")
    file = tmp_path / "driven.csv"
    written = formation("path", tmp_path / "driven", "--out", file)
    assert (written.returncode, written.stdout) == (0, f"{file}: 4 timesteps\n")
    again = short_scenario(
        "heading_deg=90",
        "leader.path=waypoints",
        f"leader.path_parameters=[file={file}]",
        # What was driven was known to nobody beforehand, and starts where the driven run did.
        "fine_tuner.first_step_m=0.0",
        "fine_tuner.first_step_u_m=0.0",
        "fine_tuner.first_turn_rad=0.0",
        "predictor.closing.step_v_m=0.0",
        "predictor.closing.step_u_m=0.0",
        "predictor.closing.step_turn_rad=0.0",
        f"start_x_m={driven.setup.start_x_m!r}",
        f"start_y_m={driven.setup.start_y_m!r}",
    )
    assert run_in_process(again, tmp_path / "again", {}).exit_code == 0
    assert displacements(tmp_path / "again") == displacements(tmp_path / "driven")
    assert formation("path", tmp_path / "again").stdout == file.read_text()


def test_a_path_with_turns_and_a_blackout_is_the_same_in_the_graph_and_in_process(tmp_path: Path) -> None:
    scenario = short_scenario(*CIRCLE, "leader.timesteps=6", "blackouts=[[4, 2]]")
    assert launch(scenario, tmp_path / "graph").exit_code == 0
    assert run_in_process(scenario, tmp_path / "process", {}).exit_code == 0
    assert displacements(tmp_path / "graph") == displacements(tmp_path / "process")
    assert len(displacements(tmp_path / "graph")) == 6
    graph, process = (load_run(tmp_path / name).followers[0] for name in ("graph", "process"))
    assert (graph.states, repr(graph.residuals)) == (process.states, repr(process.residuals))
    assert [residual.motion.finite for residual in graph.residuals] == [True, True, True, False, False, True]
