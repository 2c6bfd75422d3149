"""Overhead tracker: follows the robots' white dots in the pictures from above. It never reads ground truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.components.trail import Trail
from robot_formation.parameters import ParameterError, parameter
from robot_formation.surface import SURFACES, Surface, surface_from_texts
from robot_formation.vision.overhead.dot_tracking import OverheadTracker, OverheadTrackingParameters


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


class OverheadTrackerComponent(Component):
    """Answers each picture with the places of all robots' dots, and with their paths as far as seen."""

    fixed: ClassVar[Mapping[str, str]] = {"robots": "it decides on topics; start another tracker"}

    def __init__(self, parameters: OverheadTrackerNodeParameters, place: Place) -> None:
        super().__init__(place)
        self._tracker = OverheadTracker(parameters, parameters.make_surface(), parameters.starts())
        self._path_topics = {robot: names.overhead_path(robot) for robot in parameters.robots}
        self._trails: dict[str, Trail[Any]] = {robot: Trail() for robot in parameters.robots}
        self._pictures = 0
        self._unseen: list[str] = []

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [Input(names.OVERHEAD_IMAGE, self._on_image)]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [names.OVERHEAD_POSES, *self._path_topics.values()]

    def set_parameters(self, parameters: OverheadTrackerNodeParameters) -> None:
        """See `Component`: from the next picture on; tracks go on.

        Raises:
            FormationError: if the surface can't be made.
        """
        self._tracker.configure(parameters, parameters.make_surface(), parameters.starts())

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {"pictures": str(self._pictures), "unseen": ", ".join(self._unseen)}

    def _on_image(self, message: Any) -> None:
        try:
            picture = conversions.read_grey_image(message)
        except conversions.MessageError as error:
            self.warn(str(error))
            return
        stamp_ns = conversions.stamp_of(message)
        earlier = stamp_ns < self.stamp_ns
        if earlier:
            self._tracker.restart()
        self.stamp_ns = stamp_ns
        self._pictures += 1
        found = self._tracker.update(picture)
        if earlier or self._tracker.restarted:
            self._trails = {robot: Trail() for robot in self._trails}
        self._unseen = [robot for robot in self._trails if robot not in found]
        frame = names.WORLD_FRAME
        poses = {
            robot: conversions.place(track.place.tolist(), frame, stamp_ns)
            for robot, track in self._tracker.tracks.items()
        }
        self._send(names.OVERHEAD_POSES, conversions.pose_array(list(poses.values()), frame, stamp_ns))
        for robot in found:
            path = self._trails[robot].add(self._tracker.tracks[robot].place.tolist(), poses[robot])
            if path is not None:
                self._send(self._path_topics[robot], conversions.path(path, frame, stamp_ns))
