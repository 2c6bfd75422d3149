"""The world in which a run took place, as its bag tells: robots, camera, marker, ground."""

from __future__ import annotations

from collections.abc import Mapping

from robot_formation.bag.run_details import node_parameters
from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.parameters import from_mapping, specs


def tells_world(details: Mapping[str, str]) -> bool:
    """Return whether a run's details tell the parameters of its world."""
    return bool(node_parameters(details).get("world"))


def recorded_world(details: Mapping[str, str], where: object) -> WorldNodeParameters:
    """Make the world's parameters; those that the run doesn't tell keep their defaults.

    Args:
        details: what the run says of itself.
        where: the bag, for messages.

    Raises:
        ParameterError: the run tells parameters that can't be.
    """
    known = specs(WorldNodeParameters)
    told = {name: value for name, value in node_parameters(details).get("world", {}).items() if name in known}
    return from_mapping(WorldNodeParameters, told, where=f"{where}: world")
