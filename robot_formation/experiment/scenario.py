"""A scenario: everything that a run needs to be repeated, from YAML presets, files and `--set KEY=VALUE`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from robot_formation.calibration.camera_check import check_camera
from robot_formation.calibration.drive_check import check_curves
from robot_formation.components.catalogue import KINDS, NodeKind
from robot_formation.components.node_parameters import (
    BlockDetectorNodeParameters,
    FineTunerNodeParameters,
    OverheadTrackerNodeParameters,
    WorldNodeParameters,
)
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.errors import shown
from robot_formation.experiment.chain_defaults import (
    at_once_alignment,
    backdrop,
    chain_tolerances,
    edges_before_board,
)
from robot_formation.experiment.disturbances import pushes_of
from robot_formation.experiment.formations import slots_of, starts_of
from robot_formation.experiment.node_defaults import ScenarioError, node_defaults, read_scenario_yaml
from robot_formation.experiment.overhead_defaults import (
    overhead_calibrations,
    overhead_camera,
    too_large_for_overhead,
)
from robot_formation.experiment.path_check import PathCheck
from robot_formation.experiment.path_plan import (
    KNOWN_STEP,
    STRAIGHT,
    known_step,
    path_start,
    prediction_bounds,
    with_room,
)
from robot_formation.experiment.scenario_setup import FOLLOWS_FROM_SETUP, START, Setup
from robot_formation.follower.blind_driving import blind_timesteps
from robot_formation.follower.fine_tuning import AlignmentModeName
from robot_formation.geometry.slots import Slots, leader_places
from robot_formation.koopman.predictors import Predictor, PredictorParameters
from robot_formation.leader.leader_motion import LeaderParameters
from robot_formation.parameters import (
    ParameterError,
    check_as,
    flatten,
    from_mapping,
    specs,
    suggestion,
    to_mapping,
)
from robot_formation.paths import config_dir
from robot_formation.schedule.schedules import Spacing
from robot_formation.surface import check_surface_name, plate_size
from robot_formation.surface.base import PLATE_SIZE_M
from robot_formation.system.yaml_files import YamlError, parse_yaml
from robot_formation.vision.sensors import find_sensor, is_outside_sensor

P = TypeVar("P")
Settings = Mapping[str, Mapping[str, object]]
"""Parameters that differ from the defaults: by node, then by dotted name."""


@dataclass(frozen=True)
class Scenario:
    """A setup and every node's parameters, checked. `build` makes one; it is never changed but made anew.

    Attributes:
        setup: what a scenario says beside the nodes' parameters.
        settings: the parameters that it sets, from which it is made anew when something is changed.
        given: which entries of the setup's start were given, and are not to be chosen for the path.
    """

    setup: Setup
    settings: Settings
    given: frozenset[str]
    world: WorldNodeParameters
    overhead_tracker: OverheadTrackerNodeParameters
    drive: DriveParameters
    block_detector: BlockDetectorNodeParameters
    predictor: PredictorParameters
    fine_tuner: FineTunerNodeParameters
    leader: LeaderParameters

    @property
    def robots(self) -> list[str]:
        """Names of the robots, the leader first."""
        return self.setup.robots

    @property
    def slots(self) -> Slots:
        """The followers' places, each in its neighbour's frame."""
        return _slots(self.setup, self.fine_tuner.formation_distance_m)

    def node(self, kind: NodeKind[P]) -> P:
        """Return the parameters of a kind of node."""
        found: P = getattr(self, kind.name)
        return found

    def of_robot(self, kind: NodeKind[P], robot: str) -> P:
        """Return the parameters of one robot's node."""
        found = self.node(kind)
        if isinstance(found, FineTunerNodeParameters):
            # The leader hears every follower, a follower the one on its left.
            place = self.slots[self.robots.index(robot) - 1]
            found = replace(
                found,
                done_listeners=1 if robot == self.robots[-1] else 2,
                blackouts=self.setup.blackouts_of(robot),
                formation_distance_m=place.u_m,
                formation_ahead_m=place.v_m,
            )
        if kind.name in KNOWN_STEP and (number := self.robots.index(robot)) > 1:
            values = {**to_mapping(found), **self._known_step(kind.name, number)}
            return from_mapping(kind.parameter_class(), values, where=kind.name)
        return found

    def _known_step(self, kind: str, number: int) -> dict[str, object]:
        if self.setup.spacing is Spacing.DELAYED:  # its neighbour stands still in timestep 1
            own = self.settings.get(kind, {})
            return {name: 0.0 for name in KNOWN_STEP[kind] if name not in own}
        return known_step(kind, self.leader, leader_places(self.slots)[number], self.settings.get(kind, {}))

    def by_node(self) -> dict[str, dict[str, object]]:
        """List all parameters as plain values: by node, then by dotted name."""
        return {name: to_mapping(self.node(kind)) for name, kind in KINDS.items()}

    def hosts(self) -> Iterator[tuple[NodeKind[object], str]]:
        """Yield every node to start, in order, with its robot ('' for the run's own)."""
        for kind in KINDS.values():
            if kind.name != "overhead_tracker" or self.world.overhead.enabled:
                yield from ((kind, robot) for robot in kind.robots_of(self.setup.followers))

    def check(self) -> None:
        """Check what several nodes have to agree on: the starts, the drives, and the robots' and camera's calibrations.

        Raises:
            FormationError: naming what is wrong.
        """
        blind = [blind_timesteps(self.setup.blackouts_of(robot)) for robot in self.robots]
        last = max(frozenset().union(*blind), default=0)
        if last > self.leader.timesteps:
            raise ParameterError(
                f"'blackouts' last until timestep {last}, but the run has only {self.leader.timesteps} timesteps; "
                "shorten them or raise 'leader.timesteps'"
            )
        for robot in self.robots[1:]:
            self.of_robot(KINDS["fine_tuner"], robot)  # refuses a place that its mode can't keep
        fastest = self.world.motor.max_speed_rad_s
        if self.drive.wheel_speed_rad_s > fastest:
            raise ParameterError(
                f"drive: 'wheel_speed_rad_s' is {self.drive.wheel_speed_rad_s}, more than the world's "
                f"'motor.max_speed_rad_s' of {fastest}: every move would be refused"
            )
        if self.leader.path != STRAIGHT:
            self.check_path()  # says more than that a start that was chosen for it is off the plate
        self.world.check()
        Predictor(self.predictor)  # one from outside the package is imported and made
        find_sensor(self.block_detector.sensor)
        check_curves(self.drive, self.world, self.robots)
        check_camera(self.fine_tuner, self.world)
        if self.leader.path == STRAIGHT:
            self.check_path()

    @property
    def turns_unfollowed(self) -> bool:
        """Whether the leader's path turns, but the followers align by a mode that knows no heading."""
        if self.fine_tuner.mode is not AlignmentModeName.PAPER:
            return False
        path = self.leader.make_path()
        return any(path.motion(timestep).yaw_rad for timestep in range(1, self.leader.timesteps + 1))

    @property
    def too_large_for_overhead(self) -> bool:
        """Whether nothing looks from above because the plate is too large for it."""
        return too_large_for_overhead(self.plate_m, self.settings.get("world", {}))

    @property
    def plate_m(self) -> float:
        """Edge of the square plate."""
        return plate_size(self.world.surface, self.world.surface_parameters)

    def check_path(self, leader: LeaderParameters | None = None) -> None:
        """Check that the leader's path can be made and followed; or that of another leader, say with another seed.

        Raises:
            ParameterError: naming the robot, the timestep and what would fit.
        """
        chosen = self.leader.path != STRAIGHT and not any(entry in self.given for entry in START)
        PathCheck(leader or self.leader, self.world, self.drive, self.slots, chosen).require()


def build(setup: Setup, settings: Settings, given: Collection[str] = START) -> Scenario:
    """Make every node's parameters: the defaults, then the scenario's settings, then what follows from the setup.

    Args:
        setup: what is said beside the nodes' parameters.
        settings: the nodes' parameters that are set.
        given: which entries of the setup's start are given; the others follow from the path, unless it is straight.

    Raises:
        ParameterError: on an unknown name, a wrong type or a value out of range.
    """

    def made(cls: type[P], kind: str, **follows: object) -> P:
        values = {**node_defaults(kind, setup.marker), **settings.get(kind, {}), **follows}
        return from_mapping(cls, values, where=kind)

    leader = made(LeaderParameters, "leader", followers=setup.robots[1:], seed=setup.seed, schedule=setup.schedule)
    timed = {"schedule": setup.schedule, "timesteps": leader.timesteps, "period_s": leader.period_s}
    if setup.slots and "formation_distance_m" in settings.get("fine_tuner", {}):
        raise ParameterError("'slots' say the distances, and 'fine_tuner.formation_distance_m' does too; keep one")
    slots = _slots(setup, made(FineTunerNodeParameters, "fine_tuner").formation_distance_m)
    ground = made(WorldNodeParameters, "world")
    x_m, y_m = path_start(leader, slots, setup.heading_deg, ground) or (
        setup.start_x_m,
        setup.start_y_m,
    )
    setup = replace(
        setup,
        start_x_m=setup.start_x_m if "start_x_m" in given else x_m,
        start_y_m=setup.start_y_m if "start_y_m" in given else y_m,
    )
    own, size_m = settings.get("world", {}), _plate_size(ground)
    follows = {
        "seed": setup.seed,
        "robots": setup.robots,
        "pushes": [push.text for push in pushes_of(setup.pushes)],
        **starts_of(setup.start_x_m, setup.start_y_m, setup.heading_deg, slots),
        **backdrop(setup.followers, setup.spacing, own),
        **overhead_camera(size_m, own),
    }
    world = made(WorldNodeParameters, "world", **timed, **follows)
    tracker = settings.get("overhead_tracker", {})
    known = {name: getattr(world, name) for name in _KNOWN_FROM_ABOVE if name not in tracker}
    known |= overhead_calibrations(size_m, own, tracker)
    bounds = prediction_bounds(leader, slots, ground)
    bounds = {name: value for name, value in bounds.items() if name not in settings.get("fine_tuner", {})}
    first = {kind: known_step(kind, leader, slots[0], settings.get(kind, {})) for kind in KNOWN_STEP}
    return Scenario(
        setup,
        settings,
        frozenset(given),
        world,
        made(OverheadTrackerNodeParameters, "overhead_tracker", **known),
        made(DriveParameters, "drive"),
        made(BlockDetectorNodeParameters, "block_detector"),
        made(PredictorParameters, "predictor", **first["predictor"]),
        made(
            FineTunerNodeParameters,
            "fine_tuner",
            blackouts=setup.blackouts_of(),
            spacing=setup.spacing,
            formation_distance_m=slots[0].u_m,
            formation_ahead_m=slots[0].v_m,
            **timed,
            **edges_before_board(world.marker, settings.get("fine_tuner", {})),
            **chain_tolerances(setup.followers, setup.schedule, settings.get("fine_tuner", {})),
            **at_once_alignment(setup.schedule, settings.get("fine_tuner", {})),
            **first["fine_tuner"],
            **bounds,
        ),
        with_room(leader, world, slots),
    )


def _plate_size(ground: WorldNodeParameters) -> float:
    """Edge of the plate; of the paper's if the surface can't be made, which `Scenario.check` tells."""
    try:
        return plate_size(ground.surface, ground.surface_parameters)
    except ParameterError:
        return PLATE_SIZE_M


_KNOWN_FROM_ABOVE = ("robots", "start_x_m", "start_y_m", "surface", "surface_parameters")


def _slots(setup: Setup, distance_m: float) -> Slots:
    return slots_of(setup.formation, setup.slots, setup.followers, distance_m)


def presets() -> dict[str, Path]:
    """List the scenarios in config/scenarios by name; tracks are called track_NAME."""
    return {path.stem: path for path in sorted((config_dir() / "scenarios").glob("*.yaml"))}


def track_names() -> list[str]:
    """List what --track takes."""
    return [name.removeprefix("track_") for name in presets() if name.startswith("track_")]


def formations() -> dict[str, Path]:
    """List the presets that are no tracks, by name: formations of several followers."""
    return {name: path for name, path in presets().items() if not name.startswith("track_")}


def load_track(track: str) -> Scenario:
    """Load a preset track by its short name.

    Raises:
        ScenarioError: if there is none of this name.
    """
    if track not in track_names():
        raise ScenarioError(f"no track '{track}'{suggestion(track, track_names())}")
    return load(presets()[f"track_{track}"])


def load(path: Path) -> Scenario:
    """Read a scenario file, or the preset of that name where there is no such file.

    Raises:
        ScenarioError: if it can't be read or isn't a mapping.
        ParameterError: on unknown or wrong entries.
    """
    path = path if path.is_file() else presets().get(str(path), path)
    if not path.exists() and not path.suffix:
        raise ScenarioError(f"no scenario file or preset '{path}'{suggestion(str(path), presets())}")
    content = read_scenario_yaml(path)
    if not isinstance(content, Mapping):
        raise ScenarioError(
            f"{path}: a scenario is a mapping with entries like 'seed' and 'leader'; see config/scenarios"
        )
    return from_content({"name": path.stem, **content}, where=str(path))


def from_content(content: Mapping[str, object], *, where: str) -> Scenario:
    """Make a scenario of what a scenario file holds; `where` that is from is for messages.

    Raises:
        ScenarioError: if a node's entry isn't a mapping.
        ParameterError: on unknown or wrong entries.
    """
    known = [*specs(Setup), *KINDS]
    for key in content:
        if key not in known:
            raise ParameterError(f"{where}: no entry '{key}'{suggestion(str(key), known)}")
    setup = from_mapping(Setup, {key: value for key, value in content.items() if key not in KINDS}, where=where)
    sections: dict[str, dict[str, object]] = {}
    for kind in KINDS:
        section = content.get(kind, {})
        section = {} if section is None else section  # an entry with nothing below it
        if not isinstance(section, Mapping):
            raise ScenarioError(f"{where}: '{kind}' must hold parameters of that node, not {shown(section)}")
        sections[kind] = _checked(kind, flatten(section, where=f"{where}: {kind}"), where=f"{where}: {kind}")
    return build(setup, sections, [entry for entry in START if entry in content])


def to_content(scenario: Scenario) -> dict[str, object]:
    """Return what a scenario file would hold: what differs from the defaults, which `from_content` reads back."""
    defaults = to_mapping(Setup())
    said = to_mapping(scenario.setup)
    content: dict[str, object] = {
        name: value
        for name, value in said.items()
        if name == "name" or name in scenario.given or (name not in START and value != defaults[name])
    }
    content.update({kind: dict(section) for kind, section in scenario.settings.items() if section})
    return content


def _checked(kind: str, section: Mapping[str, object], *, where: str) -> dict[str, object]:
    for name in section:
        if name in FOLLOWS_FROM_SETUP.get(kind, {}) and not (name == "sensor" and is_outside_sensor(section[name])):
            raise ParameterError(
                f"{where}: '{name}' follows from the scenario; set {FOLLOWS_FROM_SETUP[kind][name]} instead"
            )
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
    values: list[tuple[str, object]] = []
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals:
            raise ScenarioError(f"{source} takes KEY=VALUE, like predictor.forgetting=0.95, not '{setting}'")
        values.append((key, _yaml_value(text, f"{source} {key}")))
    return with_values(scenario, values, source=source)


def _yaml_value(text: str, subject: str) -> object:
    try:
        return parse_yaml(text)
    except YamlError as error:
        raise ScenarioError(f"{subject}: {shown(text)} is no YAML value: {error.problem}") from None


def with_option(scenario: Scenario, key: str, value: object, source: str) -> Scenario:
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


def with_value(scenario: Scenario, key: str, value: object) -> Scenario:
    """Set one value: 'seed' or 'NODE.PARAMETER'. Errors as for `override`."""
    return with_values(scenario, [(key, value)])


def with_values(scenario: Scenario, values: Sequence[tuple[str, object]], *, source: str = "--set") -> Scenario:
    """Set values together, so that only their sum has to make sense. Errors as for `override`."""
    setup = to_mapping(scenario.setup)
    sections = {kind: dict(section) for kind, section in scenario.settings.items()}
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
    # A start is that of the path that it was given with.
    same_path = checked.get("leader", {}).get("path", scenario.leader.path) == scenario.leader.path
    given = {entry for entry in START if entry in dict(values) or (same_path and entry in scenario.given)}
    return build(from_mapping(Setup, setup, where=source), checked, given)


def with_surface(scenario: Scenario, surface: str) -> Scenario:
    """Return the scenario on another surface with that surface's own defaults."""
    check_surface_name(surface)
    scenario = with_value(scenario, "world.surface", surface)
    return with_value(scenario, "world.surface_parameters", [])
