"""What a scenario says beside the parameters of its nodes, and which parameters follow from it."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation import names
from robot_formation.experiment.disturbances import blackouts_of, pushes_of
from robot_formation.experiment.formations import ABREAST, FORMATIONS
from robot_formation.parameters import LENGTH_PAIRS, ROWS, parameter
from robot_formation.schedule.schedules import Schedule, Spacing, check_spacing
from robot_formation.vision.marker import MarkerKind

START = ("start_x_m", "start_y_m")

FOLLOWS_FROM_SETUP = {
    "world": {
        "marker.kind": "'marker'",
        "seed": "'seed'",
        "robots": "'followers'",
        "start_x_m": "'start_x_m' of the scenario",
        "start_y_m": "'start_y_m' of the scenario",
        "start_heading_rad": "'heading_deg' of the scenario",
        "schedule": "'schedule' of the scenario",
        "timesteps": "'leader.timesteps'",
        "period_s": "'leader.period_s'",
        "pushes": "'pushes' of the scenario",
    },
    "block_detector": {"sensor": "'marker'"},
    "leader": {
        "followers": "'followers'",
        "seed": "'seed'",
        "room_m": "the plate's size",
        "schedule": "'schedule' of the scenario",
    },
    "fine_tuner": {
        "done_listeners": "'followers'",
        "formation_ahead_m": "'formation' or 'slots' of the scenario",
        "blackouts": "'blackouts' of the scenario",
        "schedule": "'schedule' of the scenario",
        "spacing": "'spacing' of the scenario",
        "timesteps": "'leader.timesteps'",
        "period_s": "'leader.period_s'",
    },
}
"""Parameters of nodes that follow from the setup, and what is set instead."""


_START = "not given, a path other than straight starts so that all of it lies in the plate's middle"


@dataclass(frozen=True)
class Setup:
    """What a scenario says beside the nodes' parameters."""

    name: str = parameter("", "Name shown in reports")
    seed: int = parameter(0, "Seed of every random stream", low=0, high=2**63 - 1)
    followers: int = parameter(1, "Number of followers, each beside the one before", low=1, high=10)
    schedule: Schedule = parameter(Schedule.TURNS, "Who waits for whom before a timestep begins")
    spacing: Spacing = parameter(
        Spacing.RIGID,
        "What a follower's place is: beside its neighbour, or (delayed) where that was one timestep earlier",
    )
    formation: str = parameter(
        ABREAST, "Where the followers' places are; echelon: each a little behind the one before", known=FORMATIONS
    )
    slots: LENGTH_PAIRS = parameter(
        (),
        "Places of one's own in place of 'formation', each from the robot on the left: pairs of distance to the right "
        "and offset ahead (negative: behind), like [[0.32, -0.05]], one for each follower or one for all",
        unit="m",
        low=-2.0,
        high=2.0,
    )
    start_x_m: float = parameter(0.763, f"Start of the leader; {_START}", unit="m", low=-10.0, high=100.0)
    start_y_m: float = parameter(0.158, f"Start of the leader; {_START}", unit="m", low=-10.0, high=100.0)
    heading_deg: float = parameter(90.0, "Heading of the formation", unit="deg", low=-360.0, high=360.0)
    marker: MarkerKind = parameter(MarkerKind.COLOURS, "What the robots' markers carry and their cameras look for")
    blackouts: ROWS = parameter(
        (), "Timesteps without cameras: [first timestep, length] for all, [follower_2, first timestep, length] for one"
    )
    pushes: ROWS = parameter(
        (),
        "Pushes, each as [robot, timestep, metres ahead, metres to the left]: when the leader's move of the timestep "
        "has ended, the robot is displaced without turning its wheels",
    )

    def __post_init__(self) -> None:
        """Check that blackouts and pushes are such, and that the spacing fits the schedule."""
        for robot in self.robots:
            self.blackouts_of(robot)
        pushes_of(self.pushes)
        check_spacing(self.schedule, self.spacing)

    @property
    def robots(self) -> list[str]:
        """Names of the robots, the leader first."""
        return [names.LEADER, *(names.follower(n) for n in range(1, self.followers + 1))]

    def blackouts_of(self, robot: str = "") -> tuple[int, ...]:
        """List first timesteps and lengths of a follower's blackouts, as its fine-tuner has them; '': those of all."""
        return blackouts_of(self.blackouts, self.robots, robot)
