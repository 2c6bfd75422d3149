"""A whole run in memory: from a scenario to its analysis without a bag."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from robot_formation import exit_codes, names
from robot_formation.analysis.from_bag import GroundTruth, record_of, run_topics
from robot_formation.analysis.run_record import RunRecord
from robot_formation.bag.run_details import slots_text
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.progress import Progress
from robot_formation.experiment.run_result import RunResult
from robot_formation.experiment.scenario import Scenario
from robot_formation.names import Message
from robot_formation.parameters import to_mapping
from robot_formation.world.events import RobotPose

OUTCOMES = {exit_codes.DONE: "done", exit_codes.LOST: "lost"}


MakeRun = Callable[[Scenario, Callable[[str, Message], None]], InProcessRun]


def run_in_memory(scenario: Scenario, make_run: MakeRun | None = None, *, ground: bool = True) -> RunRecord:
    """Run a scenario in this process and return its record, as a bag of it would give it.

    Args:
        scenario: what to run.
        make_run: builds the run from the scenario and its listener; by default a plain `InProcessRun`.
        ground: whether the surface's mesh is wanted, which figures show and no quantity needs.

    Raises:
        FormationError: if a component refuses its parameters, or the run stands still.
    """
    # What the analysis reads of a run's parameters: spacing, distances, the marker's height.
    parameters = {"fine_tuner": to_mapping(scenario.fine_tuner), "world": to_mapping(scenario.world)}
    details = {
        "scenario": scenario.setup.name,
        "timesteps": str(scenario.leader.timesteps),
        "slots": slots_text(scenario.slots),
        "parameters": json.dumps(parameters),
    }
    return run_with_details(scenario, details, make_run, ground=ground)[0]


def run_with_details(
    scenario: Scenario,
    details: Mapping[str, str],
    make_run: MakeRun | None = None,
    beside: Progress | None = None,
    *,
    ground: bool = True,
) -> tuple[RunRecord, RunResult]:
    """Run a scenario in this process; return its record, and how it ended.

    Args:
        scenario: what to run.
        details: what the run says of itself, as a bag's metadata has it.
        make_run: builds the run from the scenario and its listener; by default a plain `InProcessRun`.
        beside: listens too.
        ground: see `run_in_memory`.

    Raises:
        FormationError: if a component refuses its parameters, or the run stands still.
    """
    # Ground truth comes as the world's own poses: a message of each would cost more than all else that is kept.
    kept = set(run_topics(scenario.robots)) - {names.ground_truth_odom(robot).of() for robot in scenario.robots}
    if not ground:
        kept.remove(names.SURFACE.of())
    messages: dict[str, list[Message]] = defaultdict(list)
    stamps: dict[str, list[int]] = defaultdict(list)
    poses: dict[str, list[RobotPose]] = {robot: [] for robot in scenario.robots}

    def listen(topic: str, message: Message) -> None:
        if topic in kept:
            messages[topic].append(message)
            stamps[topic].append(run.stamp_ns)
        if beside is not None:
            beside.listen(topic, message)

    run = make_run(scenario, listen) if make_run is not None else InProcessRun(scenario, listen=listen)
    run.on_pose = lambda event: poses[event.robot].append(event)
    run.heard = kept.union(beside.topics if beside is not None else ())
    code, reason = run.run()
    outcome = {"outcome": OUTCOMES.get(code, "incomplete")}
    truth = {robot: _ground_truth(events) for robot, events in poses.items() if events}
    record = record_of(scenario.robots, messages, {**details, **outcome}, stamps, truth)
    return record, RunResult(code, None, reason, run.warnings)


def _ground_truth(events: Sequence[RobotPose]) -> GroundTruth:
    """Gather a robot's poses as ground-truth odometry tells them."""
    return GroundTruth(
        np.array([event.stamp_ns for event in events], dtype=np.int64),
        np.array([event.state.pose.position for event in events]),
        np.array([event.state.pose.orientation for event in events]),
    )
