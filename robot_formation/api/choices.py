"""What can be named: of the package itself, and of installed packages that add to it."""

from __future__ import annotations

from collections.abc import Iterable

from robot_formation import plugins


def scenarios() -> list[str]:
    """List the scenarios that come with the package: what `load_scenario` takes besides files."""
    from robot_formation.experiment.scenario import presets

    return list(presets())


def leader_paths() -> list[str]:
    """List the leader's paths. Nothing from outside is imported."""
    from robot_formation.leader.paths import PATHS

    return _with_installed("path", PATHS)


def surfaces() -> list[str]:
    """List the surfaces. Nothing from outside is imported."""
    from robot_formation.surface import SURFACES

    return _with_installed("surface", SURFACES)


def predictors() -> list[str]:
    """List the predictors. Nothing from outside is imported."""
    from robot_formation.koopman.predictors import NAMES

    return _with_installed("predictor", NAMES)


def sensors() -> list[str]:
    """List the sensors that find the neighbour's marker in pictures. Nothing from outside is imported."""
    from robot_formation.vision.sensors import SENSORS

    return _with_installed("sensor", SENSORS)


def _with_installed(kind: str, own: Iterable[str]) -> list[str]:
    return list(dict.fromkeys([*own, *plugins.installed(kind)]))
