"""The parameters that a node has where a scenario is silent: config/NODE.yaml over the defaults of its class."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from robot_formation.errors import FormationError
from robot_formation.parameters import flatten
from robot_formation.paths import config_dir
from robot_formation.system.yaml_files import read_yaml
from robot_formation.vision.marker import MarkerKind


class ScenarioError(FormationError):
    """A scenario, a preset or an override can't be used."""


def node_defaults(kind: str, marker: MarkerKind = MarkerKind.COLOURS) -> dict[str, object]:
    """Read what config/NODE.yaml has other than the class of the node's parameters, flat.

    What config/MARKER/NODE.yaml has, the folder being called like the marker's kind, goes before it.

    Raises:
        ScenarioError: if a file has not the form of a ROS parameter file.
    """
    values = parameter_file(config_dir() / f"{kind}.yaml")
    overlay = config_dir() / marker.value / f"{kind}.yaml"
    if overlay.exists():
        values.update(parameter_file(overlay))
    return values


def parameter_file(path: Path) -> dict[str, object]:
    """Read a ROS parameter file for nodes of any name, flat.

    Raises:
        ScenarioError: if it can't be read or has another form.
    """
    # A run asks for them many times, and PyYAML takes milliseconds each.
    changed_ns = path.stat().st_mtime_ns if path.exists() else 0
    return dict(_parameter_file(path, changed_ns))


@lru_cache(maxsize=64)
def _parameter_file(path: Path, changed_ns: int) -> dict[str, object]:
    content = read_scenario_yaml(path)
    try:
        return flatten(content["/**"]["ros__parameters"], where=str(path))  # type: ignore[index]
    except (KeyError, TypeError, AttributeError):
        raise ScenarioError(f"{path}: a ROS parameter file begins with '/**:' and 'ros__parameters:'") from None


def read_scenario_yaml(path: Path) -> object:
    """Read a YAML file of a scenario or of parameters.

    Raises:
        ScenarioError: if it can't be read.
    """
    remedy = "give a scenario's YAML file, or a name of 'formation list scenarios'"
    return read_yaml(path, refuse=ScenarioError, remedy=remedy)
