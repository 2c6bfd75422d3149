"""Parameters of nodes that follow a run: what they have to know of it beforehand."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.geometry.slots import Slots, slot
from robot_formation.parameters import ParameterError, parameter


@dataclass(frozen=True)
class FollowedRunParameters:
    """What is followed."""

    followers: int = parameter(1, "Number of followers", low=1, high=10)
    timesteps: int = parameter(15, "Timesteps of the run; 0: not known", low=0, high=1_000_000)
    slots: tuple[float, ...] = parameter(
        (),
        "Each follower's place, for the formation error: distance to its neighbour's right, offset ahead, one after "
        "another; empty: 0.32 m beside",
        unit="m",
        low=-2.0,
        high=2.0,
    )
    delayed: bool = parameter(False, "Whether places are those of one timestep earlier, for the formation error")

    def __post_init__(self) -> None:
        """Check that each follower has a place."""
        if len(self.slots) not in (0, 2 * self.followers):
            raise ParameterError(
                f"'slots' has {len(self.slots)} numbers, not two for each of {self.followers} followers"
            )

    def places(self) -> Slots:
        """List the followers' places, each in its neighbour's frame."""
        pairs = zip(self.slots[::2], self.slots[1::2], strict=True)
        return [slot(*pair) for pair in pairs] or [slot(FORMATION_DISTANCE_M)] * self.followers
