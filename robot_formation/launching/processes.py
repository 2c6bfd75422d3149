"""The processes of a run, from one table: our own launcher and launch/formation.launch.py both start these."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robot_formation import names
from robot_formation.bag.provenance import versions
from robot_formation.bag.run_details import slots_text
from robot_formation.bag.write_options import DEFAULT_OPTIONS, WriteOptions
from robot_formation.calibration.camera_check import camera_values
from robot_formation.calibration.drive_check import robot_curves
from robot_formation.experiment.scenario import Scenario
from robot_formation.experiment.stand_ins import TIMEOUT_S
from robot_formation.json_values import Json, JsonObject
from robot_formation.names import RECORDER
from robot_formation.parameters import to_mapping
from robot_formation.schedule.schedules import Spacing
from robot_formation.system.git_commit import git_commit
from robot_formation.system.yaml_files import yaml_text


@dataclass(frozen=True)
class Process:
    """One node: executable, namespace, and its parameters by dotted name; a stand-in is started by somebody else."""

    executable: str
    namespace: str
    parameters: Mapping[str, Json]
    stand_in: bool = False

    @property
    def name(self) -> str:
        """The node's full name, for people."""
        return _inside(self.namespace, self.executable)

    def ros_parameters(self) -> JsonObject:
        """Return the parameters as a ROS parameter file holds them: no empty lists, ROS can't tell their type."""
        return {name: value for name, value in self.parameters.items() if value != []}

    def write_parameters(self, folder: Path) -> Path:
        """Write the parameters as a ROS parameter file for a node of any name; return the file."""
        file = folder / f"{self.stem}.yaml"
        text = yaml_text({"/**": {"ros__parameters": self.ros_parameters()}}, sort_keys=True)
        file.write_text(text, encoding="utf-8")
        return file

    @property
    def stem(self) -> str:
        """The node's full name as that of a file."""
        return self.name.strip("/").replace("/", "_")


def processes(
    scenario: Scenario,
    bag: Path | None,
    *,
    images: bool = False,
    options: WriteOptions = DEFAULT_OPTIONS,
    patience_s: float = 60.0,
    namespace: str = "/",
    stand_ins: Collection[str] = (),
) -> list[Process]:
    """List the processes of a run in the order of their start.

    Args:
        scenario: what to run.
        bag: where the recorder writes; None for no recorder.
        images: whether pictures are recorded too.
        options: how the bag's files are split.
        patience_s: how long a node waits for its listeners.
        namespace: where the formation lies; one that doesn't begin with '/' gives relative ones, for launch.
        stand_ins: nodes that somebody else starts, as `experiment.stand_ins` names them; they are listed too.
    """
    host = {
        "wait_for_nodes": list(stand_ins),
        "wait_for_listeners_s": patience_s,
        "recorder": RECORDER if bag else "",
        "record_images": images and bool(bag),
    }
    found = []
    if bag is not None:
        parameters = {
            "path": str(bag),
            "images": images,
            "split_bytes": options.split_bytes,
            "split_s": options.split_ns / 1e9,
            "own_namespace": True,
            "metadata": [f"{k}={v}" for k, v in run_metadata(scenario, stand_ins).items()],
        }
        found.append(Process(RECORDER, namespace, parameters))
    for kind, robot in scenario.hosts():
        values = {**to_mapping(scenario.of_robot(kind, robot)), **host}
        stand_in = names.under(robot, kind.name) in stand_ins
        found.append(Process(kind.name, _inside(namespace, robot), values, stand_in))
    return found


def progress(
    scenario: Scenario, namespace: str, stand_ins: Sequence[str] = (), stand_in_timeout_s: float = TIMEOUT_S
) -> Process:
    """Make the process that prints a launched run's progress; `formation run` follows the run itself.

    Args:
        scenario: what is run.
        namespace: where the formation lies.
        stand_ins: nodes that somebody else starts, which it waits for.
        stand_in_timeout_s: how long it does.
    """
    waiting = {"stand_ins": list(stand_ins), "stand_in_timeout_s": stand_in_timeout_s}
    return Process(names.PROGRESS, namespace, {**_followed(scenario), **waiting})


def _followed(scenario: Scenario) -> JsonObject:
    """List what a node that follows a run has to know of it."""
    return {
        "followers": scenario.setup.followers,
        "timesteps": scenario.leader.timesteps,
        "slots": [length for place in scenario.slots for length in place.uv_m],
        "delayed": scenario.setup.spacing is Spacing.DELAYED,
    }


def viewer(scenario: Scenario, port: int) -> Process:
    """Make the process that shows a run in a browser.

    Args:
        scenario: what is run.
        port: on which it serves.
    """
    return Process(names.VIEWER, "/", {**_followed(scenario), "port": port})


def _inside(namespace: str, robot: str) -> str:
    """Return a robot's namespace ('': the formation's own) in that of its formation."""
    if not robot:
        return namespace
    return f"{namespace.rstrip('/')}/{robot}" if namespace else robot


def run_metadata(scenario: Scenario, stand_ins: Collection[str] = ()) -> dict[str, str]:
    """Describe a run for the bag's metadata record: scenario, seed, what ran with which parameters and versions.

    Args:
        scenario: what is run.
        stand_ins: nodes that somebody else starts; the parameters of their kind may not be theirs.
    """
    world, setup = scenario.world, scenario.setup
    blind = {robot: setup.blackouts_of(robot) for robot in scenario.robots[1:]}
    own = {robot: found for robot, found in blind.items() if found != setup.blackouts_of()}
    return {
        "scenario": scenario.setup.name,
        "seed": str(scenario.setup.seed),
        "predictor": scenario.predictor.name,
        "path": scenario.leader.path,
        "surface": world.surface,
        "surface_parameters": json.dumps(dict(text.split("=", 1) for text in world.surface_parameters)),
        "timesteps": str(scenario.leader.timesteps),
        "slots": slots_text(scenario.slots),
        "camera": world.camera.mode.value,
        "parameters": json.dumps(scenario.by_node(), sort_keys=True),
        "drive_curves": json.dumps(robot_curves(scenario.drive, scenario.robots)),
        "camera_calibration": json.dumps(camera_values(scenario.fine_tuner)),
        "versions": json.dumps(versions()),
        "git_commit": git_commit(),
        **({"own_blackouts": json.dumps(own)} if own else {}),
        **({"stand_ins": json.dumps(list(stand_ins))} if stand_ins else {}),
    }
