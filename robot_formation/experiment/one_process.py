"""Whether a scenario can be run in one process."""

from __future__ import annotations

from robot_formation.errors import FormationError
from robot_formation.experiment.scenario import Scenario


def check_one_process(scenario: Scenario) -> None:
    """Check that a scenario can be run in one process.

    Raises:
        FormationError: it needs the node graph.
    """
    if scenario.world.real_time_factor > 0.0:
        raise FormationError(
            "a run in one process goes as fast as it can; leave world.real_time_factor (--real-time-factor) out"
        )
    if scenario.leader.path == "teleop":
        raise FormationError("path teleop is driven over ROS topics, as by 'formation run' without --in-process")
