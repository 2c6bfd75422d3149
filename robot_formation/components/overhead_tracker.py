"""Overhead tracker: follows the robots' white dots in the pictures from above. It never reads ground truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.components.node_parameters import OverheadTrackerNodeParameters
from robot_formation.components.trail import Trail
from robot_formation.names import Message
from robot_formation.vision.overhead.dot_tracking import OverheadTracker


class OverheadTrackerComponent(Component):
    """Answers each picture with the places of all robots' dots, and with their paths as far as seen."""

    fixed: ClassVar[Mapping[str, str]] = {"robots": "it decides on topics; start another tracker"}

    def __init__(self, parameters: OverheadTrackerNodeParameters, place: Place) -> None:
        super().__init__(place)
        self._tracker = OverheadTracker(parameters, parameters.make_surface(), parameters.starts())
        self._path_topics = {robot: names.overhead_path(robot) for robot in parameters.robots}
        self._trails: dict[str, Trail[conversions.PathPose]] = {robot: Trail() for robot in parameters.robots}
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

    def _on_image(self, message: Message) -> None:
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
            place = self._tracker.tracks[robot].place.tolist()
            path = self._trails[robot].add(place, conversions.path_pose(place, frame, stamp_ns))
            if path is not None:
                self._send(self._path_topics[robot], conversions.path(path, frame, stamp_ns))
