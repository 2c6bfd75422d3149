"""Scenarios: what a run needs to be repeated."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from robot_formation.api.inputs import path_of
from robot_formation.errors import FormationError, shown
from robot_formation.experiment import scenario as definitions
from robot_formation.experiment.choices import choose
from robot_formation.parameters import flatten


@dataclass(frozen=True, repr=False, eq=False)
class Scenario:
    """Everything that a run needs to be repeated. It never changes: `changed` returns another one.

    `load_scenario` and `Scenario.from_dict` make one.

    Attributes:
        definition: the scenario as the package itself handles it; not part of the documented interface.
    """

    definition: definitions.Scenario

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Scenario:
        """Make a scenario of what a scenario file holds, as `to_dict` returns it.

        Raises:
            FormationError: naming what is misspelt, out of range, or doesn't fit together.
        """
        if not isinstance(content, Mapping):
            raise FormationError(f"a scenario's content is a mapping, like {{'seed': 3}}, not {shown(content)}")
        return _checked(definitions.from_content(plain(content), where="scenario"))

    @property
    def name(self) -> str:
        """Its name, shown in reports."""
        return self.definition.setup.name

    @property
    def seed(self) -> int:
        """Seed of every random stream."""
        return self.definition.setup.seed

    @property
    def followers(self) -> int:
        """Number of followers."""
        return self.definition.setup.followers

    @property
    def timesteps(self) -> int:
        """Number of timesteps that the leader drives."""
        return self.definition.leader.timesteps

    @property
    def predictor(self) -> str:
        """Name of the followers' predictor."""
        return self.definition.predictor.name

    @property
    def surface(self) -> str:
        """Name of the surface."""
        return self.definition.world.surface

    @property
    def path(self) -> str:
        """Name of the leader's path."""
        return self.definition.leader.path

    @property
    def settings(self) -> dict[str, Any]:
        """What was set: values by name, `seed` or `NODE.PARAMETER`. `changed` takes such names."""
        return flatten(self.to_dict())

    @property
    def parameters(self) -> dict[str, Any]:
        """Every parameter of every node, given or by default: values by `NODE.PARAMETER`."""
        return {f"{node}.{name}": value for node, found in self.definition.by_node().items()
                for name, value in found.items()}  # fmt: skip

    def changed(
        self,
        *,
        seed: int | None = None,
        predictor: str | None = None,
        followers: int | None = None,
        surface: str | None = None,
        path: str | None = None,
        schedule: str | None = None,
        camera: str | None = None,
        timesteps: int | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> Scenario:
        """Return the scenario with some things changed; what isn't given stays as it is.

        Args:
            seed: of every random stream.
            predictor: a name of `predictors()`, or `module:Class`.
            followers: how many.
            surface: a name of `surfaces()`, or `module:Class`; its own parameters are the defaults again.
            path: the leader's: a name of `leader_paths()`, or `module:Class`.
            schedule: who waits for whom: turns, wave, together or timer.
            camera: stream (every frame) or on_demand (only the frames that are asked for, which is faster).
            timesteps: how many the leader drives.
            settings: any parameter by its name on the nodes' pages, like `{"world.imperfections.motor_gain": 0.0}`.

        Raises:
            FormationError: naming what is misspelt, out of range, or doesn't fit together.
        """
        chosen = {
            "seed": seed,
            "predictor": predictor,
            "followers": followers,
            "surface": surface,
            "path": path,
            "schedule": schedule,
            "camera": camera,
            "timesteps": timesteps,
        }
        found = choose(self.definition, plain(chosen), str)
        return _checked(definitions.with_values(found, settings_of(settings), source="settings"))

    def to_dict(self) -> dict[str, Any]:
        """Return what was set, as a scenario file holds it: plain values, a mapping per node."""
        return definitions.to_content(self.definition)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it as a YAML file, which `load_scenario` and `formation run --scenario` take.

        Raises:
            FormationError: the file can't be written.
        """
        file = path_of("path", path)
        try:
            file.write_text(yaml.safe_dump(self.to_dict(), sort_keys=False, allow_unicode=True), encoding="utf-8")
        except OSError as error:
            raise FormationError(f"{file} can't be written: {error.strerror or error}") from error
        return file

    def __eq__(self, other: object) -> bool:
        """Return whether another scenario has the same values, given or by default."""
        if not isinstance(other, Scenario):
            return NotImplemented
        own, theirs = self.definition, other.definition
        return own.setup == theirs.setup and own.by_node() == theirs.by_node()

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Return the essentials in a line."""
        said = [f"{self.name!r}", f"predictor {self.predictor}", f"surface {self.surface}", f"path {self.path}"]
        said += [f"seed {self.seed}", f"{self.followers} follower{'s' * (self.followers > 1)}"]
        return f"<Scenario {', '.join(said)}, {self.timesteps} timesteps>"


def load_scenario(source: str | os.PathLike[str]) -> Scenario:
    """Load a scenario.

    Args:
        source: a name of `scenarios()`, like "track_two", or a YAML file.

    Raises:
        FormationError: there is none of this name, or naming what in the file is wrong.
    """
    return _checked(definitions.load(path_of("source", source)))


def definition_of(scenario: object) -> definitions.Scenario:
    """Return the scenario as the package itself handles it.

    Raises:
        FormationError: it is none.
    """
    if isinstance(scenario, Scenario):
        return scenario.definition
    raise FormationError(f"give a scenario, like load_scenario('track_two'), not {shown(scenario)}")


def _checked(definition: definitions.Scenario) -> Scenario:
    definition.check()
    return Scenario(definition)


def settings_of(settings: Mapping[str, Any] | None) -> list[tuple[str, Any]]:
    """Return settings by their dotted names, as plain values.

    Raises:
        FormationError: they are no mapping, or name something twice.
    """
    if settings is not None and not isinstance(settings, Mapping):
        raise FormationError(f"settings is a mapping, like {{'leader.timesteps': 5}}, not {shown(settings)}")
    return list(flatten(plain(settings or {}), where="settings").items())


def plain(value: Any) -> Any:
    """Return a value with NumPy's numbers and arrays, tuples and paths as Python's numbers, lists and texts."""
    if isinstance(value, Mapping):
        return {str(name): plain(inner) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(inner) for inner in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    return os.fspath(value) if isinstance(value, os.PathLike) else value
