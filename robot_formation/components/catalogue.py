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
        parameter_class: imports and returns the class of its parameters, which needs neither ROS nor PyBullet.
        component_class: imports and returns the class of its component. Imported when asked for: no node pays for
            another's libraries.
    """

    name: str
    robots: Robots
    parameter_class: Callable[[], type[P]]
    component_class: Callable[[], ComponentClass[P]]

    def robots_of(self, followers: int) -> list[str]:
        """List the robots that have this node; [''] for a node of the run's own."""
        of_followers = [names.follower(n) for n in range(1, followers + 1)]
        return {
            Robots.NONE: [""],
            Robots.ALL: [names.LEADER, *of_followers],
            Robots.LEADER: [names.LEADER],
            Robots.FOLLOWERS: of_followers,
        }[self.robots]


def _world_parameters() -> type[WorldNodeParameters]:
    from robot_formation.components.node_parameters import WorldNodeParameters

    return WorldNodeParameters


def _world_component() -> ComponentClass[WorldNodeParameters]:
    from robot_formation.components.world import WorldComponent

    return WorldComponent


def _overhead_tracker_parameters() -> type[OverheadTrackerNodeParameters]:
    from robot_formation.components.node_parameters import OverheadTrackerNodeParameters

    return OverheadTrackerNodeParameters


def _overhead_tracker_component() -> ComponentClass[OverheadTrackerNodeParameters]:
    from robot_formation.components.overhead_tracker import OverheadTrackerComponent

    return OverheadTrackerComponent


def _drive_parameters() -> type[DriveParameters]:
    from robot_formation.drive.movement_system import DriveParameters

    return DriveParameters


def _drive_component() -> ComponentClass[DriveParameters]:
    from robot_formation.components.drive import DriveComponent

    return DriveComponent


def _block_detector_parameters() -> type[BlockDetectorNodeParameters]:
    from robot_formation.components.node_parameters import BlockDetectorNodeParameters

    return BlockDetectorNodeParameters


def _block_detector_component() -> ComponentClass[BlockDetectorNodeParameters]:
    from robot_formation.components.block_detector import BlockDetectorComponent

    return BlockDetectorComponent


def _predictor_parameters() -> type[PredictorParameters]:
    from robot_formation.koopman.predictors import PredictorParameters

    return PredictorParameters


def _predictor_component() -> ComponentClass[PredictorParameters]:
    from robot_formation.components.predictor import PredictorComponent

    return PredictorComponent


def _fine_tuner_parameters() -> type[FineTunerNodeParameters]:
    from robot_formation.components.node_parameters import FineTunerNodeParameters

    return FineTunerNodeParameters


def _fine_tuner_component() -> ComponentClass[FineTunerNodeParameters]:
    from robot_formation.components.fine_tuner import FineTunerComponent

    return FineTunerComponent


def _leader_parameters() -> type[LeaderParameters]:
    from robot_formation.leader.leader_motion import LeaderParameters

    return LeaderParameters


def _leader_component() -> ComponentClass[LeaderParameters]:
    from robot_formation.components.leader import LeaderComponent

    return LeaderComponent


# In the order of start.
_ALL: tuple[NodeKind[Any], ...] = (
    NodeKind("world", Robots.NONE, _world_parameters, _world_component),
    NodeKind("overhead_tracker", Robots.NONE, _overhead_tracker_parameters, _overhead_tracker_component),
    NodeKind("drive", Robots.ALL, _drive_parameters, _drive_component),
    NodeKind("block_detector", Robots.FOLLOWERS, _block_detector_parameters, _block_detector_component),
    NodeKind("predictor", Robots.FOLLOWERS, _predictor_parameters, _predictor_component),
    NodeKind("fine_tuner", Robots.FOLLOWERS, _fine_tuner_parameters, _fine_tuner_component),
    NodeKind("leader", Robots.LEADER, _leader_parameters, _leader_component),
)
KINDS = {kind.name: kind for kind in _ALL}
