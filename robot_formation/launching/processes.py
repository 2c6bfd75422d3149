"""The processes of a run, from one table: our own launcher and launch/formation.launch.py both start these."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from robot_formation import names
from robot_formation.bag.provenance import versions
from robot_formation.calibration.camera_check import camera_values
from robot_formation.calibration.drive_check import robot_curves
from robot_formation.experiment.scenario import Scenario
from robot_formation.json_values import Json, JsonObject
from robot_formation.parameters import to_mapping
from robot_formation.schedule.schedules import Spacing
from robot_formation.system.git_commit import git_commit

RECORDER = "recorder"


@dataclass(frozen=True)
class Process:
    """One node: executable, namespace, and its parameters by dotted name."""

    executable: str
    namespace: str
    parameters: Mapping[str, Json]

    @property
    def name(self) -> str:
        """The node's full name, for people."""
        return _inside(self.namespace, self.executable)

    def ros_parameters(self) -> JsonObject:
        """Return the parameters as a ROS parameter file holds them: no empty lists, ROS can't tell their type."""
        return {name: value for name, value in self.parameters.items() if value != []}


def processes(
    scenario: Scenario, bag: Path | None, *, images: bool = False, patience_s: float = 60.0, namespace: str = "/"
) -> list[Process]:
    """List the processes of a run in the order of their start.

    Args:
        scenario: what to run.
        bag: where the recorder writes; None for no recorder.
        images: whether pictures are recorded too.
        patience_s: how long a node waits for its listeners.
        namespace: where the formation lies; one that doesn't begin with '/' gives relative ones, for launch.
    """
    host = {
        "wait_for_listeners_s": patience_s,
        "recorder": RECORDER if bag else "",
        "record_images": images and bool(bag),
    }
    found = []
    if bag is not None:
        parameters = {
            "path": str(bag),
            "images": images,
            "own_namespace": True,
            "metadata": [f"{k}={v}" for k, v in run_metadata(scenario).items()],
        }
        found.append(Process(RECORDER, namespace, parameters))
    for kind, robot in scenario.hosts():
        values = {**to_mapping(scenario.of_robot(kind, robot)), **host}
        found.append(Process(kind.name, _inside(namespace, robot), values))
    return found


def progress(scenario: Scenario, namespace: str) -> Process:
    """Make the process that prints a launched run's progress; `formation run` follows the run itself."""
    parameters = {
        "followers": scenario.setup.followers,
        "timesteps": scenario.leader.timesteps,
        "formation_distance_m": scenario.fine_tuner.formation_distance_m,
        "delayed": scenario.setup.spacing is Spacing.DELAYED,
    }
    return Process(names.PROGRESS, namespace, parameters)


def viewer(scenario: Scenario, port: int) -> Process:
    """Make the process that shows a run in a browser.

    Args:
        scenario: what is run.
        port: on which it serves.
    """
    known = progress(scenario, "/").parameters
    return Process(names.VIEWER, "/", {**known, "port": port})


def _inside(namespace: str, robot: str) -> str:
    """Return a robot's namespace ('': the formation's own) in that of its formation."""
    if not robot:
        return namespace
    return f"{namespace.rstrip('/')}/{robot}" if namespace else robot


def run_metadata(scenario: Scenario) -> dict[str, str]:
    """Describe a run for the bag's metadata record: scenario, seed, what ran with which parameters and versions."""
    world = scenario.world
    return {
        "scenario": scenario.setup.name,
        "seed": str(scenario.setup.seed),
        "predictor": scenario.predictor.name,
        "path": scenario.leader.path,
        "surface": world.surface,
        "surface_parameters": json.dumps(dict(text.split("=", 1) for text in world.surface_parameters)),
        "timesteps": str(scenario.leader.timesteps),
        "camera": world.camera.mode.value,
        "parameters": json.dumps(scenario.by_node(), sort_keys=True),
        "drive_curves": json.dumps(robot_curves(scenario.drive, scenario.robots)),
        "camera_calibration": json.dumps(camera_values(scenario.fine_tuner)),
        "versions": json.dumps(versions()),
        "git_commit": git_commit(),
    }
