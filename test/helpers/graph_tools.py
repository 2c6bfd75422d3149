"""Starts real runs for the graph tests, in the test's own folder, and looks at what they leave behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from robot_formation.analysis.from_bag import load_run
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.run_result import RunResult
from robot_formation.experiment.scenario import Scenario
from robot_formation.launching.fork_server import ForkServer
from robot_formation.launching.launcher import Launcher
from robot_formation.launching.processes import Process

SHORT = ("leader.timesteps=4", "world.camera.mode=on_demand")

STRICT = {
    "PYTHONDEVMODE": "1",
    "PYTHONMALLOC": "default",  # without the checks of memory, which are about C code, and slow
    # The ROS wheels' parser of message definitions (lark-parser 0.12) imports modules of Python that are to go.
    "PYTHONWARNINGS": "error,ignore:module 'sre_:DeprecationWarning",
}
"""Python's development mode, and warnings as errors; one about a file left open only is printed."""


def short_scenario(*settings: str, track: str = "two", seed: int = 3) -> Scenario:
    """A scenario of a few timesteps."""
    return scenarios.override(scenarios.load_track(track), [f"seed={seed}", *SHORT, *settings])


def displacements(bag: Path, follower: int = 0) -> list[tuple[int, float, float, float]]:
    """What the follower says it drove, exactly as recorded."""
    return [
        (entry.stamp_ns, entry.motion.x_m, entry.motion.y_m, entry.motion.yaw_rad)
        for entry in load_run(bag).followers[follower].displacements
    ]


def launch(
    scenario: Scenario,
    bag: Path | None,
    *,
    on_start: Callable[[int, dict[str, int]], None] | None = None,
    **options: Any,
) -> RunResult:
    """Run a scenario through the node graph; returns the result.

    Once all processes run, `on_start` is called with the ROS domain and the process ids by node name.
    """
    launcher = Launcher(scenario, bag, **options)
    start = launcher._start

    def observed(table: list[Process], folder: Path, server: ForkServer) -> None:
        start(table, folder, server)
        if on_start is not None:
            on_start(int(server.environment["ROS_DOMAIN_ID"]), {child.name: child.pid for child in launcher._children})

    launcher._start = observed  # type: ignore[method-assign]
    return launcher.run()


def formation(*arguments: object, timeout: float = 300, **options: Any) -> subprocess.CompletedProcess[str]:
    """Call the command line as a user does; neither it nor a node that it starts may give a Python warning."""
    command = [sys.executable, "-m", "robot_formation.cli", *map(str, arguments)]
    options["env"] = {**options.get("env", os.environ), **STRICT}
    completed = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False, **options)
    assert "Warning" not in completed.stderr
    return completed


def json_of(completed: subprocess.CompletedProcess[str]) -> Any:
    """Read what a verb printed with --json: nothing else may stand on standard output."""
    return json.loads(completed.stdout)


def alive(pid: int) -> bool:
    """Whether a process runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class BusyCores:
    """Keeps every core busy with processes of the same priority; a context manager."""

    def __enter__(self) -> BusyCores:
        code = "while True: pass"
        self._processes = [subprocess.Popen([sys.executable, "-S", "-c", code]) for _ in range(os.cpu_count() or 2)]
        return self

    def __exit__(self, *error: object) -> None:
        for process in self._processes:
            process.kill()
            process.wait()


class Killer:
    """Sends a signal to one node of a run, or to another process, when the run has finished a number of timesteps.

    Where there are several followers, `robot` is the one whose timesteps count.
    """

    def __init__(self, node: str, number: signal.Signals, after_timesteps: int, robot: str = "") -> None:
        self._node, self._number = node, number
        self._line = f"{robot}  " * bool(robot) + f"timestep {after_timesteps:2d}/"
        self.pids: dict[str, int] = {}

    def started(self, domain: int, pids: Mapping[str, int]) -> None:
        self.pids = dict(pids)

    def say(self, text: str) -> None:
        if text.startswith(self._line):
            os.kill(self.pids[self._node], self._number)
            if self._number is signal.SIGSTOP:
                self._until_stopped(self.pids[self._node])

    @staticmethod
    def _until_stopped(pid: int) -> None:
        """A busy process takes a moment to stop, and the run may look at its state at once."""
        end = time.monotonic() + 10.0
        while Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "T":
            assert time.monotonic() < end, f"process {pid} does not stop"
            time.sleep(0.001)
