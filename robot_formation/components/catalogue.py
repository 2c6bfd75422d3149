"""The one table of nodes: which component and parameters each executable has, and where it runs."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class NodeKind:
    """An executable: its component and parameter classes by module path, and whether each robot has one of its own."""

    name: str
    component: str
    parameters: str
    robots: str  # "": one for the run; "all": one per robot; "leader" or "followers"

    def component_class(self) -> Any:
        """Import the component's class."""
        return _import(self.component)

    def parameter_class(self) -> Any:
        """Import the parameters' class."""
        return _import(self.parameters)

    def robots_of(self, followers: int) -> list[str]:
        """List the robots that have this node; [''] for a node of the run's own."""
        follower_names = [f"follower_{n}" for n in range(1, followers + 1)]
        return {"": [""], "all": ["leader", *follower_names], "leader": ["leader"], "followers": follower_names}[
            self.robots
        ]


def _import(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def _kind(name: str, stem: str, parameters: str, robots: str) -> NodeKind:
    base = f"robot_formation.components.{name}"
    path = parameters if "." in parameters else f"{base}.{parameters}"
    return NodeKind(name, f"{base}.{stem}Component", path, robots)


# Order of start. Components are imported when asked for: no node pays for another's libraries.
KINDS: dict[str, NodeKind] = {
    kind.name: kind
    for kind in (
        _kind("world", "World", "WorldNodeParameters", ""),
        _kind("overhead_tracker", "OverheadTracker", "OverheadTrackerNodeParameters", ""),
        _kind("drive", "Drive", "robot_formation.drive.movement_system.DriveParameters", "all"),
        _kind("block_detector", "BlockDetector", "BlockDetectorNodeParameters", "followers"),
        _kind("predictor", "Predictor", "robot_formation.koopman.predictors.PredictorParameters", "followers"),
        _kind("fine_tuner", "FineTuner", "FineTunerNodeParameters", "followers"),
        _kind("leader", "Leader", "robot_formation.leader.leader_motion.LeaderParameters", "leader"),
    )
}
