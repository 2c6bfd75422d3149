"""What is chosen of a scenario by options of their own, beside its settings NODE.PARAMETER."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from robot_formation.experiment.scenario import Scenario, with_option, with_surface

OPTIONS: Mapping[str, str] = MappingProxyType(
    {
        "path": "leader.path",
        "predictor": "predictor.name",
        "seed": "seed",
        "followers": "followers",
        "schedule": "schedule",
        "camera": "world.camera.mode",
        "timesteps": "leader.timesteps",
        "real_time_factor": "world.real_time_factor",
    }
)
"""What can be chosen by name, beside the surface, and which entry or parameter of a scenario that is."""


def choose(scenario: Scenario, chosen: Mapping[str, object], named: Callable[[str], str]) -> Scenario:
    """Return the scenario with some choices made; None: as it is.

    Args:
        scenario: what is changed.
        chosen: values by name, `surface` or one of `OPTIONS`. Another surface comes with its own defaults.
        named: what the user calls a choice, for messages.

    Raises:
        FormationError: on a wrong value.
    """
    surface = chosen.get("surface")
    if surface is not None:
        scenario = with_surface(scenario, str(surface))
    for name, key in OPTIONS.items():
        value = chosen.get(name)
        if value is not None:
            scenario = with_option(scenario, key, value, named(name))
    return scenario
