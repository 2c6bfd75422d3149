"""The command that repeats a run, found from what its bag says: checked by making its scenario again."""

from __future__ import annotations

import contextlib
import json
import math
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from robot_formation.bag.run_details import mapping, node_parameters, said_slots, stand_ins
from robot_formation.components.catalogue import KINDS
from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.scenario import Scenario
from robot_formation.experiment.scenario_setup import FOLLOWS_FROM_SETUP
from robot_formation.json_values import Json, JsonObject
from robot_formation.parameters import to_mapping
from robot_formation.world.pushes import read_push

_PRESET = "track_"
_OPTIONS = {"predictor.name": "--predictor", "leader.path": "--path", "world.camera.mode": "--camera"}
_DEFAULT_TRACK = "two"
_NO_WORDS = ("true", "false", "null", "yes", "no", "on", "off")  # to YAML


@dataclass(frozen=True)
class Repetition:
    """How a run is repeated.

    Attributes:
        command: for a shell.
        missed: parameters (NODE.PARAMETER) of the run that get other values by it, or are none any more.
    """

    command: str
    missed: tuple[str, ...]


def repetition(details: Mapping[str, str]) -> Repetition | None:
    """Find the command that repeats a run; None where it doesn't say its parameters, or they can't be run today."""
    nodes = node_parameters(details)
    if any(kind not in nodes for kind in KINDS):
        return None
    try:
        found, scenario = _found(details, nodes)
        scenario.check()
        return found
    except (FormationError, KeyError, TypeError, ValueError, IndexError, OverflowError):
        return None  # parameters from outside, which may be anything


def _found(details: Mapping[str, str], nodes: dict[str, JsonObject]) -> tuple[Repetition, Scenario]:
    name = details.get("scenario", "")
    track = name.removeprefix(_PRESET)
    preset = track if name.startswith(_PRESET) and track in scenarios.track_names() else _DEFAULT_TRACK
    words = ["formation", "run", "--track", preset]
    settings = _setup(name, details, nodes, scenarios.load_track(preset))
    scenario = scenarios.override(scenarios.load_track(preset), settings)
    tried: set[str] = set()
    # What one setting changes, others may follow: the rest is looked for again.
    for _ in range(len(KINDS)):
        more = [setting for setting in _differing(nodes, scenario) if setting not in tried]
        if not more:
            break
        tried.update(more)
        scenario, taken = _with(scenario, more)
        settings += taken
    own = scenario.by_node()
    gone = [f"{node}.{name}" for node in KINDS for name in nodes[node] if name not in own[node]]
    missed = (*(name for name, _ in _other(nodes, scenario)), *gone)
    without = [word for node in stand_ins(details) for word in ("--without", node)]
    return Repetition(shlex.join([*words, *_as_options(settings), *without]), missed), scenario


def _with(scenario: Scenario, settings: list[str]) -> tuple[Scenario, list[str]]:
    """Apply settings together, or each alone and without those that are refused; return those that were applied."""
    try:
        return scenarios.override(scenario, settings), settings
    except FormationError:
        taken = []
    for setting in settings:
        with contextlib.suppress(FormationError):  # it is named among what is missed
            scenario = scenarios.override(scenario, [setting])
            taken.append(setting)
    return scenario, taken


def _setup(name: str, details: Mapping[str, str], nodes: dict[str, JsonObject], preset: Scenario) -> list[str]:
    """Write the setup of a run that has these parameters as settings KEY=VALUE, as far as the preset's is another."""
    world, fine_tuner = nodes["world"], nodes["fine_tuner"]
    wanted: JsonObject = {
        "name": name,
        "seed": world["seed"],
        "followers": len(world["robots"]) - 1,
        "schedule": world["schedule"],
        "spacing": fine_tuner["spacing"],
        "marker": world["marker.kind"],
        "heading_deg": _degrees(world["start_heading_rad"][0]),
        "slots": _slots(details, fine_tuner["formation_distance_m"]),
        "blackouts": _blackouts(fine_tuner["blackouts"], mapping(details, "own_blackouts")),
        "pushes": [_push_row(text) for text in world.get("pushes", [])],
    }
    own = to_mapping(preset.setup)
    settings = [f"{key}={_yaml(value)}" for key, value in wanted.items() if value not in (own[key], "")]
    # Before the start, which a path chooses if it isn't given.
    for key in ("leader.path", "leader.path_parameters", "world.surface", "world.surface_parameters"):
        node, _, parameter = key.partition(".")
        if nodes[node][parameter] != preset.by_node()[node][parameter]:
            settings.append(f"{key}={_yaml(nodes[node][parameter])}")
    start = (world["start_x_m"][0], world["start_y_m"][0])
    chosen = scenarios.override(preset, settings).setup
    if (chosen.start_x_m, chosen.start_y_m) != start:
        settings += [f"start_x_m={_yaml(start[0])}", f"start_y_m={_yaml(start[1])}"]
    return settings


def _slots(details: Mapping[str, str], distance_m: float) -> list[list[float]]:
    """Return the places as a scenario has them; none where all are abreast in the fine-tuner's distance."""
    slots = said_slots(details)
    return [] if all(place == (distance_m, 0.0) for place in slots) else [list(place) for place in slots]


def _blackouts(of_all: list[int], own: JsonObject) -> list[list[Json]]:
    """Return rows of blackouts as a scenario has them: those of all, then what single followers have beside them."""
    common = _pairs(of_all)
    rows: list[list[Json]] = [*common]
    for robot, numbers in own.items():
        rows += [[robot, *pair] for pair in _pairs(numbers) if pair not in common]
    return rows


def _pairs(numbers: list[int]) -> list[list[Json]]:
    return [list(pair) for pair in zip(numbers[::2], numbers[1::2], strict=True)]


def _push_row(text: str) -> list[Json]:
    """Return a push as a scenario has it, from the text that the world has."""
    push = read_push(text, "'pushes'")
    return [push.robot, push.timestep, push.x_m, push.y_m]


def _differing(nodes: dict[str, JsonObject], scenario: Scenario) -> Iterator[str]:
    """Write what a scenario has other than the run, and lets be set, as settings KEY=VALUE."""
    for key, value in _other(nodes, scenario):
        node, _, name = key.partition(".")
        if name not in FOLLOWS_FROM_SETUP.get(node, {}):
            yield f"{key}={_yaml(value)}"


def _other(nodes: dict[str, JsonObject], scenario: Scenario) -> Iterator[tuple[str, Json]]:
    """Yield the parameters that are others in the run than in a scenario, with the run's values."""
    for node, parameters in scenario.by_node().items():
        for name, value in parameters.items():
            if name in nodes[node] and nodes[node][name] != value:
                yield f"{node}.{name}", nodes[node][name]


def _as_options(settings: list[str]) -> Iterator[str]:
    """Write settings with an option of their own by it, the others by --set."""
    for setting in settings:
        key, _, value = setting.partition("=")
        option = {**_OPTIONS, "seed": "--seed", "schedule": "--schedule"}.get(key)
        yield from (option, value) if option else ("--set", setting)


def _degrees(heading_rad: float) -> float:
    """Return the heading in degrees that gives this one in radians again; rounded, if that does."""
    rounded = round(math.degrees(heading_rad), 9)
    return rounded if math.radians(rounded) == heading_rad else math.degrees(heading_rad)


def _yaml(value: Json) -> str:
    """Write a value as `--set` reads it: JSON is YAML, and a word stands for itself."""
    if isinstance(value, str) and value.isidentifier() and value.lower() not in _NO_WORDS:
        return value
    return json.dumps(value)
