"""The parameters of the nodes that have more of them than what they are built around; without ROS and PyBullet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robot_formation import names
from robot_formation.follower.fine_tuning import FineTunerParameters
from robot_formation.parameters import ParameterError, parameter
from robot_formation.paths import config_dir
from robot_formation.schedule.schedules import Schedule, Spacing, check_spacing, period_parameter
from robot_formation.surface import SURFACES, Surface, surface_from_texts
from robot_formation.vision.marker import MarkerKind
from robot_formation.vision.overhead.tracking_parameters import OverheadTrackingParameters
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.signatures import Signature, load_signatures
from robot_formation.vision.sensors import SENSORS, is_outside_sensor
from robot_formation.vision.tag_parameters import TagParameters
from robot_formation.world.checks import check_setup
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pushes import Push, check_push, read_push
from robot_formation.world.start import RobotStart


@dataclass(frozen=True)
class WorldNodeParameters(WorldParameters):
    """The world's parameters, its surface, its robots and where they start."""

    seed: int = parameter(0, "Seed of every random stream", low=0, high=2**63 - 1)
    surface: str = parameter("bowl", "Name of the surface", known=tuple(SURFACES))
    surface_parameters: tuple[str, ...] = parameter((), "The surface's own parameters, each as 'name=value'")
    robots: tuple[str, ...] = parameter(("leader", "follower_1"), "Names of the robots; followers carry a camera")
    start_x_m: tuple[float, ...] = parameter((0.76, 1.08), "Start of each robot's base_link in the world", unit="m")
    start_y_m: tuple[float, ...] = parameter((0.16, 0.16), "Start of each robot's base_link in the world", unit="m")
    start_heading_rad: tuple[float, ...] = parameter((1.5707963, 1.5707963), "Start headings", unit="rad")
    real_time_factor: float = parameter(
        0.0, "Simulated seconds per wall second; 0 is as fast as possible", low=0.0, high=1000.0
    )
    leaving_ends_run: bool = parameter(
        True, "End with exit code 3 when a robot's reference dot leaves the plate; false: only hold the robot there"
    )
    schedule: Schedule = parameter(
        Schedule.TURNS, "Who waits for whom: in all but turns the world hears ticks, to know whose orders are to come"
    )
    timesteps: int = parameter(20, "Timesteps of the run, for schedules other than turns", low=1, high=100000)
    period_s: float = period_parameter()
    pushes: tuple[str, ...] = parameter(
        (),
        "Each as 'robot timestep x_m y_m': at the end of the leader's move of the timestep the robot is displaced by "
        "so much in its own frame, without turning its wheels",
    )

    def __post_init__(self) -> None:
        """Check that every robot has a start."""
        super().__post_init__()
        lengths = {len(self.start_x_m), len(self.start_y_m), len(self.start_heading_rad), len(self.robots)}
        if len(lengths) != 1 or len(set(self.robots)) != len(self.robots):
            raise ParameterError(
                "world: 'robots' must differ and have one start_x_m, start_y_m and start_heading_rad each"
            )
        for push in self.read_pushes():
            check_push(push, self.robots, self.timesteps)

    def read_pushes(self) -> list[Push]:
        """Read the pushes."""
        return [read_push(text) for text in self.pushes]

    def starts(self) -> list[RobotStart]:
        """List the robots with their start poses."""
        poses = zip(self.robots, self.start_x_m, self.start_y_m, self.start_heading_rad, strict=True)
        return [RobotStart(name, x, y, heading, camera=name != names.LEADER) for name, x, y, heading in poses]

    def make_surface(self) -> Surface:
        """Build the surface that the parameters name."""
        return surface_from_texts(self.surface, self.surface_parameters)

    def check(self) -> None:
        """Check the surface and the starts on it, as far as that can be done without a world.

        Raises:
            FormationError: on a surface that can't be made, or a robot that would start beyond the plate.
        """
        check_setup(self.make_surface(), self.starts(), self, self.seed)


@dataclass(frozen=True)
class OverheadTrackerNodeParameters(OverheadTrackingParameters):
    """The tracker's own parameters, which robots there are, where they start, and the ground as far as it is known."""

    robots: tuple[str, ...] = parameter(("leader", "follower_1"), "Names of the robots, in the order of the poses")
    start_x_m: tuple[float, ...] = parameter(
        (0.76, 1.08), "Start of each robot's base_link in the world", unit="m", low=-10.0, high=100.0
    )
    start_y_m: tuple[float, ...] = parameter(
        (0.16, 0.16), "Start of each robot's base_link in the world", unit="m", low=-10.0, high=100.0
    )
    surface: str = parameter(
        "bowl", "Name of the surface that a calibration with knows_surface means", known=tuple(SURFACES)
    )
    surface_parameters: tuple[str, ...] = parameter((), "The surface's own parameters, each as 'name=value'")

    def __post_init__(self) -> None:
        """Check that every robot has a start."""
        lengths = {len(self.start_x_m), len(self.start_y_m), len(self.robots)}
        if len(lengths) != 1 or len(set(self.robots)) != len(self.robots):
            raise ParameterError("overhead_tracker: 'robots' must differ and have one start_x_m and start_y_m each")

    def starts(self) -> dict[str, tuple[float, float]]:
        """List where each robot begins: x and y in the world, metres."""
        return dict(zip(self.robots, zip(self.start_x_m, self.start_y_m, strict=True), strict=True))

    def make_surface(self) -> Surface:
        """Build the surface that the parameters name."""
        return surface_from_texts(self.surface, self.surface_parameters)


@dataclass(frozen=True)
class BlockDetectorNodeParameters(DetectorParameters):
    """The camera's own parameters, where its taught signatures are stored, and the search for tags instead."""

    sensor: str = parameter(
        MarkerKind.COLOURS.value,
        "What is looked for; colours: blocks of the taught colours; tags: the ArUco tags of a marker of that kind; "
        "or a sensor of another package, or 'module:Class'",
        choices=tuple(SENSORS),
        also=is_outside_sensor,
    )

    signatures_file: str = parameter(
        "", "YAML or JSON file of taught signatures; empty: config/signatures.yaml, taught under the world's light"
    )

    tags: TagParameters = TagParameters()

    def load(self) -> list[Signature]:
        """Read the taught signatures.

        Raises:
            SignatureError: if the file can't be read or holds no signatures.
        """
        return load_signatures(Path(self.signatures_file) if self.signatures_file else config_dir() / "signatures.yaml")


@dataclass(frozen=True)
class FineTunerNodeParameters(FineTunerParameters):
    """The fine-tuner's parameters and who listens to its tick."""

    schedule: Schedule = parameter(Schedule.TURNS, "Who waits for whom before a timestep begins")
    spacing: Spacing = parameter(
        Spacing.RIGID,
        "What the place is; delayed: where it was one timestep earlier, with a schedule of moves at the same time",
    )
    period_s: float = period_parameter()
    timesteps: int = parameter(20, "Timesteps of the run, for the schedules wave and timer", low=1, high=100000)
    done_listeners: int = parameter(
        1,
        "Nodes that wait for this follower's tick: the leader, and the follower behind if there is one",
        low=0,
        high=2,
    )

    def __post_init__(self) -> None:
        """Check that the spacing fits the schedule."""
        super().__post_init__()
        check_spacing(self.schedule, self.spacing)
