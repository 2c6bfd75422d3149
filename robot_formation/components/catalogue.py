"""The one table of nodes that have a component: their component and parameter classes, and which robots have them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from robot_formation import names
from robot_formation.components.base import Component, Place
from robot_formation.parameters import Choice

if TYPE_CHECKING:
    from robot_formation.components.node_parameters import (
        BlockDetectorNodeParameters,
        FineTunerNodeParameters,
        OverheadTrackerNodeParameters,
        WorldNodeParameters,
    )
    from robot_formation.drive.movement_system import DriveParameters
    from robot_formation.koopman.predictors import PredictorParameters
    from robot_formation.leader.leader_motion import LeaderParameters

P = TypeVar("P")
_P = TypeVar("_P", contravariant=True)


class ComponentClass(Protocol[_P]):
    """A class of components with parameters of a class of their own."""

    @property
    def fixed(self) -> Mapping[str, str]:
        """See `Component`."""

    def __call__(self, parameters: _P, place: Place) -> Component:
        """Make the component."""


Classes = tuple[type[P], ComponentClass[P]]


class Robots(Choice):
    """Which robots have a node of a kind; none: there is one for the whole run."""

    NONE = ""
    ALL = "all"
    LEADER = "leader"
    FOLLOWERS = "followers"


@dataclass(frozen=True)
class NodeKind(Generic[P]):
    """An executable with a component.

    Attributes:
        name: of the executable, and of its section in a scenario.
        robots: which robots have one.
        classes: imports and returns the classes of its parameters and of its component. Imported when asked for: no
            node pays for another's libraries.
    """

    name: str
    robots: Robots
    classes: Callable[[], Classes[P]]

    def parameter_class(self) -> type[P]:
        """Import the parameters' class."""
        return self.classes()[0]

    def component_class(self) -> ComponentClass[P]:
        """Import the component's class."""
        return self.classes()[1]

    def robots_of(self, followers: int) -> list[str]:
        """List the robots that have this node; [''] for a node of the run's own."""
        of_followers = [names.follower(n) for n in range(1, followers + 1)]
        return {
            Robots.NONE: [""],
            Robots.ALL: [names.LEADER, *of_followers],
            Robots.LEADER: [names.LEADER],
            Robots.FOLLOWERS: of_followers,
        }[self.robots]


def _world() -> Classes[WorldNodeParameters]:
    from robot_formation.components.node_parameters import WorldNodeParameters
    from robot_formation.components.world import WorldComponent

    return WorldNodeParameters, WorldComponent


def _overhead_tracker() -> Classes[OverheadTrackerNodeParameters]:
    from robot_formation.components.node_parameters import OverheadTrackerNodeParameters
    from robot_formation.components.overhead_tracker import OverheadTrackerComponent

    return OverheadTrackerNodeParameters, OverheadTrackerComponent


def _drive() -> Classes[DriveParameters]:
    from robot_formation.components.drive import DriveComponent
    from robot_formation.drive.movement_system import DriveParameters

    return DriveParameters, DriveComponent


def _block_detector() -> Classes[BlockDetectorNodeParameters]:
    from robot_formation.components.block_detector import BlockDetectorComponent
    from robot_formation.components.node_parameters import BlockDetectorNodeParameters

    return BlockDetectorNodeParameters, BlockDetectorComponent


def _predictor() -> Classes[PredictorParameters]:
    from robot_formation.components.predictor import PredictorComponent
    from robot_formation.koopman.predictors import PredictorParameters

    return PredictorParameters, PredictorComponent


def _fine_tuner() -> Classes[FineTunerNodeParameters]:
    from robot_formation.components.fine_tuner import FineTunerComponent
    from robot_formation.components.node_parameters import FineTunerNodeParameters

    return FineTunerNodeParameters, FineTunerComponent


def _leader() -> Classes[LeaderParameters]:
    from robot_formation.components.leader import LeaderComponent
    from robot_formation.leader.leader_motion import LeaderParameters

    return LeaderParameters, LeaderComponent


# In the order of start.
_ALL: tuple[NodeKind[Any], ...] = (
    NodeKind("world", Robots.NONE, _world),
    NodeKind("overhead_tracker", Robots.NONE, _overhead_tracker),
    NodeKind("drive", Robots.ALL, _drive),
    NodeKind("block_detector", Robots.FOLLOWERS, _block_detector),
    NodeKind("predictor", Robots.FOLLOWERS, _predictor),
    NodeKind("fine_tuner", Robots.FOLLOWERS, _fine_tuner),
    NodeKind("leader", Robots.LEADER, _leader),
)
KINDS = {kind.name: kind for kind in _ALL}
