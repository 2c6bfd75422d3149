"""A scenario: everything that a run needs to be repeated, from YAML presets, files and `--set KEY=VALUE`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from robot_formation import names
from robot_formation.calibration.camera_check import check_camera
from robot_formation.calibration.drive_check import check_curves
from robot_formation.components.catalogue import KINDS, NodeKind
from robot_formation.errors import FormationError, shown
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.parameters import (
    ParameterError,
    check_as,
    flatten,
    from_mapping,
    parameter,
    specs,
    suggestion,
    to_mapping,
)
from robot_formation.paths import config_dir
from robot_formation.surface import SURFACES
from robot_formation.system.yaml_files import YamlError, parse_yaml, read_yaml

# Parameters that follow from the setup, and what to set instead.
_FIXED = {
    "world": {
        "marker.kind": "'marker'",
        "seed": "'seed'",
        "robots": "'followers'",
        "start_x_m": "'start_x_m' of the scenario",
        "start_y_m": "'start_y_m' of the scenario",
        "start_heading_rad": "'heading_deg' of the scenario",
    },
    "block_detector": {"sensor": "'marker'"},
    "leader": {"followers": "'followers'"},
    "fine_tuner": {"done_listeners": "'followers'"},
}


class ScenarioError(FormationError):
    """A scenario, a preset or an override can't be used."""


@dataclass(frozen=True)
class Setup:
    """What a scenario says beside the nodes' parameters."""

    name: str = parameter("", "Name shown in reports")
    seed: int = parameter(0, "Seed of every random stream", low=0, high=2**63 - 1)
    followers: int = parameter(1, "Number of followers, each beside the one before", low=1, high=9)
    start_x_m: float = parameter(0.763, "Start of the leader", unit="m", low=-10.0, high=100.0)
    start_y_m: float = parameter(0.158, "Start of the leader", unit="m", low=-10.0, high=100.0)
    heading_deg: float = parameter(90.0, "Heading of the formation", unit="deg", low=-360.0, high=360.0)
    marker: str = parameter(
        "colours", "What the robots' markers carry and their cameras look for", choices=("colours", "tags")
    )


@dataclass(frozen=True)
class Scenario:
    """A setup and the parameters that differ from config/, flat, by node kind."""

    setup: Setup
    sections: Mapping[str, Mapping[str, Any]]

    @property
    def robots(self) -> list[str]:
        """Names of the robots, the leader first."""
        return [names.LEADER, *(names.follower(n) for n in range(1, self.setup.followers + 1))]

    def parameters(self, kind: str) -> dict[str, Any]:
        """Collect a node's parameters: config/, then the scenario's, then what the setup fixes; flat and checked.

        With `marker: tags` the files in config/tags, which hold what differs then, come after those in config/.

        Raises:
            ParameterError: on an unknown name, a wrong type or a value out of range.
        """
        values = {**self._defaults(kind), **self.sections.get(kind, {})}
        if kind == "world":
            values.update(self._world())
        elif kind == "overhead_tracker":
            world = self.parameters("world")
            known = ("robots", "start_x_m", "start_y_m", "surface", "surface_parameters")
            values = {**values, **{name: world[name] for name in known}, **self.sections.get(kind, {})}
        elif kind == "leader":
            values["followers"] = self.robots[1:]
        checked = from_mapping(KINDS[kind].parameter_class(), values, where=kind)
        return to_mapping(checked)

    def _defaults(self, kind: str) -> dict[str, Any]:
        values = node_defaults(kind)
        overlay = config_dir() / "tags" / f"{kind}.yaml"
        if self.setup.marker == "tags" and overlay.exists():
            values.update(parameter_file(overlay))
        return values

    def hosts(self) -> Iterator[tuple[NodeKind, str]]:
        """Yield every node to start, in order, with its robot ('' for the run's own)."""
        overhead = self.parameters("world")["overhead.enabled"]
        for kind in KINDS.values():
            if kind.name != "overhead_tracker" or overhead:
                yield from ((kind, robot) for robot in kind.robots_of(self.setup.followers))

    def robot_parameters(self, kind: str, robot: str) -> dict[str, Any]:
        """Collect the parameters of one robot's node."""
        values = self.parameters(kind)
        if kind == "fine_tuner":
            # The leader hears every follower, a follower the one on its left.
            values["done_listeners"] = 1 if robot == self.robots[-1] else 2
        return values

    def check(self) -> None:
        """Check every node's parameters, the surface's, and the drives' and the camera's calibrations.

        Raises:
            FormationError: naming what is wrong.
        """
        for kind in KINDS:
            self.parameters(kind)
        world, drive = self.parameters("world"), self.parameters("drive")
        if drive["wheel_speed_rad_s"] > world["motor.max_speed_rad_s"]:
            raise ParameterError(
                f"drive: 'wheel_speed_rad_s' is {drive['wheel_speed_rad_s']}, more than the world's "
                f"'motor.max_speed_rad_s' of {world['motor.max_speed_rad_s']}: every move would be refused"
            )
        from_mapping(KINDS["world"].parameter_class(), world, where="world").check()
        check_curves(self)
        check_camera(self)

    def _world(self) -> dict[str, Any]:
        heading = math.radians(self.setup.heading_deg)
        right = (math.sin(heading), -math.cos(heading))
        places = [FORMATION_DISTANCE_M * n for n in range(len(self.robots))]
        return {
            "seed": self.setup.seed,
            "robots": self.robots,
            "start_x_m": [self.setup.start_x_m + d * right[0] for d in places],
            "start_y_m": [self.setup.start_y_m + d * right[1] for d in places],
            "start_heading_rad": [heading] * len(self.robots),
        }


def presets() -> dict[str, Path]:
    """List the scenarios in config/scenarios by name; tracks are called track_NAME."""
    return {path.stem: path for path in sorted((config_dir() / "scenarios").glob("*.yaml"))}


def track_names() -> list[str]:
    """List what --track takes."""
    return [name.removeprefix("track_") for name in presets() if name.startswith("track_")]


def load_track(track: str) -> Scenario:
    """Load a preset track by its short name.

    Raises:
        ScenarioError: if there is none of this name.
    """
    if track not in track_names():
        raise ScenarioError(f"no track '{track}'{suggestion(track, track_names())}")
    return load(presets()[f"track_{track}"])


def load(path: Path) -> Scenario:
    """Read a scenario file.

    Raises:
        ScenarioError: if it can't be read or isn't a mapping.
        ParameterError: on unknown or wrong entries.
    """
    content = _read(path)
    if not isinstance(content, Mapping):
        raise ScenarioError(
            f"{path}: a scenario is a mapping with entries like 'seed' and 'leader'; see config/scenarios"
        )
    known = [*specs(Setup), *KINDS]
    for key in content:
        if key not in known:
            raise ParameterError(f"{path}: no entry '{key}'{suggestion(str(key), known)}")
    top = {key: value for key, value in content.items() if key not in KINDS}
    setup = from_mapping(Setup, {"name": path.stem, **top}, where=str(path))
    sections = {}
    for kind in KINDS:
        section = content.get(kind, {})
        section = {} if section is None else section  # an entry with nothing below it
        if not isinstance(section, Mapping):
            raise ScenarioError(f"{path}: '{kind}' must hold parameters of that node, not {shown(section)}")
        sections[kind] = _checked(kind, flatten(section, where=f"{path}: {kind}"), where=f"{path}: {kind}")
    return Scenario(setup, sections)


def _checked(kind: str, section: Mapping[str, Any], *, where: str) -> dict[str, Any]:
    for name in section:
        if name in _FIXED.get(kind, {}):
            raise ParameterError(f"{where}: '{name}' follows from the scenario; set {_FIXED[kind][name]} instead")
    checked = to_mapping(from_mapping(KINDS[kind].parameter_class(), {**node_defaults(kind), **section}, where=where))
    return {name: checked[name] for name in section}


def override(scenario: Scenario, settings: Sequence[str], *, source: str = "--set") -> Scenario:
    """Apply settings like 'predictor.forgetting=0.95' or 'seed=3'; the value is read as YAML.

    Args:
        scenario: what is changed.
        settings: KEY=VALUE each.
        source: where the user wrote them, for messages.

    Raises:
        ScenarioError: if a setting has no '=' or names no node.
        ParameterError: on an unknown parameter or a wrong value.
    """
    values: list[tuple[str, Any]] = []
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals:
            raise ScenarioError(f"{source} takes KEY=VALUE, like predictor.forgetting=0.95, not '{setting}'")
        values.append((key, _yaml_value(text, f"{source} {key}")))
    return with_values(scenario, values, source=source)


def _yaml_value(text: str, subject: str) -> Any:
    try:
        return parse_yaml(text)
    except YamlError as error:
        raise ScenarioError(f"{subject}: {shown(text)} is no YAML value: {error.problem}") from None


def with_option(scenario: Scenario, key: str, value: Any, source: str) -> Scenario:
    """Set 'seed' or 'NODE.PARAMETER' from an option of its own; errors name only the option.

    Args:
        scenario: what is changed.
        key: an entry of the setup, or a node's parameter.
        value: the value; a text is read as YAML unless the parameter is a text.
        source: what the user wrote, like '--seed' or 'seed:='; errors begin with it.

    Raises:
        FormationError: on a wrong value.
    """
    kind, dot, name = key.partition(".")
    spec = specs(KINDS[kind].parameter_class())[name] if dot else specs(Setup)[key]
    if isinstance(value, str) and spec.type is not str:
        value = _yaml_value(value, source)
    return with_value(scenario, key, check_as(spec, value, source))


def with_value(scenario: Scenario, key: str, value: Any) -> Scenario:
    """Set one value: 'seed' or 'NODE.PARAMETER'. Errors as for `override`."""
    return with_values(scenario, [(key, value)])


def with_values(scenario: Scenario, values: Sequence[tuple[str, Any]], *, source: str = "--set") -> Scenario:
    """Set values together, so that only their sum has to make sense. Errors as for `override`."""
    setup = to_mapping(scenario.setup)
    sections = {kind: dict(section) for kind, section in scenario.sections.items()}
    for key, value in values:
        kind, dot, name = key.partition(".")
        if dot and kind not in KINDS:
            raise ParameterError(f"{source}: no node '{kind}'{suggestion(kind, KINDS)}")
        if not dot and key not in setup:
            raise ParameterError(f"{source}: no entry '{key}'{suggestion(key, [*setup, *(f'{k}.' for k in KINDS)])}")
        if dot:
            sections.setdefault(kind, {}).update(flatten({name: value}, where=source))
        else:
            setup[key] = value
    checked = {kind: _checked(kind, section, where=f"{source}: {kind}") for kind, section in sections.items()}
    return Scenario(from_mapping(Setup, setup, where=source), checked)


def with_surface(scenario: Scenario, surface: str) -> Scenario:
    """Put the scenario on another surface with that surface's own defaults."""
    if surface not in SURFACES:
        raise ParameterError(f"no surface '{surface}'{suggestion(surface, SURFACES)}")
    scenario = with_value(scenario, "world.surface", surface)
    return with_value(scenario, "world.surface_parameters", [])


def node_defaults(kind: str) -> dict[str, Any]:
    """Read config/NODE.yaml: the parameters of a node in ROS's own file format, flat.

    Raises:
        ScenarioError: if the file has not the form of a ROS parameter file.
    """
    return parameter_file(config_dir() / f"{kind}.yaml")


def parameter_file(path: Path) -> dict[str, Any]:
    """Read a ROS parameter file for nodes of any name, flat.

    Raises:
        ScenarioError: if it can't be read or has another form.
    """
    # A run asks for them many times, and PyYAML takes milliseconds each.
    changed_ns = path.stat().st_mtime_ns if path.exists() else 0
    return dict(_parameter_file(path, changed_ns))


@lru_cache(maxsize=64)
def _parameter_file(path: Path, changed_ns: int) -> dict[str, Any]:
    content = _read(path)
    try:
        return flatten(content["/**"]["ros__parameters"], where=str(path))
    except (KeyError, TypeError, AttributeError):
        raise ScenarioError(f"{path}: a ROS parameter file begins with '/**:' and 'ros__parameters:'") from None


def _read(path: Path) -> Any:
    return read_yaml(path, refuse=ScenarioError, remedy="give a scenario's YAML file, like those in config/scenarios")
