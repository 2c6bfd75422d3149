"""A whole run in memory: from a scenario to its analysis without a bag."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable

from robot_formation import conversions, exit_codes, names
from robot_formation.analysis.from_bag import record_of, run_topics
from robot_formation.analysis.run_record import RunRecord
from robot_formation.bag.run_details import slots_text
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.scenario import Scenario
from robot_formation.names import Message
from robot_formation.parameters import to_mapping

OUTCOMES = {exit_codes.DONE: "done", exit_codes.LOST: "lost"}


def run_in_memory(
    scenario: Scenario, make_run: Callable[[Scenario, Callable[[str, Message], None]], InProcessRun] | None = None
) -> RunRecord:
    """Run a scenario in this process and return its record, as a bag of it would give it.

    Args:
        scenario: what to run.
        make_run: builds the run from the scenario and its listener; by default a plain `InProcessRun`.

    Raises:
        FormationError: if a component refuses its parameters, or the run stands still.
    """
    wanted = run_topics(scenario.robots)
    messages: dict[str, list[Message]] = defaultdict(list)
    stamps: dict[str, list[int]] = defaultdict(list)
    now_ns = 0
    clock = names.CLOCK_TOPIC.of()

    def listen(topic: str, message: Message) -> None:
        nonlocal now_ns
        if topic == clock:
            now_ns = conversions.read_clock(message)
        elif topic in wanted:
            messages[topic].append(message)
            stamps[topic].append(now_ns)

    run = make_run(scenario, listen) if make_run is not None else InProcessRun(scenario, listen=listen)
    code, _ = run.run()
    details = {
        "scenario": scenario.setup.name,
        "timesteps": str(scenario.leader.timesteps),
        "slots": slots_text(scenario.slots),
        # What the analysis reads of them: spacing, distances, the marker's height.
        "parameters": json.dumps({"fine_tuner": to_mapping(scenario.fine_tuner), "world": to_mapping(scenario.world)}),
        "outcome": OUTCOMES.get(code, "incomplete"),
    }
    return record_of(scenario.robots, messages, details, stamps)
