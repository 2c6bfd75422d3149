"""What is the case in a run that goes on, from its messages as they come."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robot_formation import conversions, names
from robot_formation.geometry.se2 import Motion
from robot_formation.names import Message, Topic
from robot_formation.viewing.moment import FollowerNow, Forecast, Moment, Picture, RobotPose, finite_angles
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_drawing import drawn

Handler = Callable[[Message], None]
_KEPT_BLOCKS = 8


class LiveMoments:
    """Collects messages; topics are relative to the formation's namespace.

    Messages of different topics come in any order: what belongs together is found by stamps.

    Args:
        robots: their names, the leader first.
        formation_distance_m: the fine-tuners'.
        delayed: whether places are those beside where neighbours stood one timestep earlier.
    """

    def __init__(self, robots: tuple[str, ...], formation_distance_m: float, *, delayed: bool = False) -> None:
        self._robots, self._delayed = robots, delayed
        self._to_place = Motion(y_m=-formation_distance_m)
        self._poses: dict[str, RobotPose] = {}
        self._joints: dict[str, dict[str, float]] = {robot: {} for robot in robots}
        self._states: dict[str, str] = {}
        self._ends: dict[str, list[int]] = {robot: [] for robot in robots}
        self._rests: dict[str, list[tuple[int, Motion]]] = {robot: [] for robot in robots}
        self._predictions: dict[str, tuple[int, Motion | None, tuple[float, ...]]] = {}
        self._pictures: dict[str, tuple[int, Picture]] = {}
        self._blocks: dict[str, dict[int, list[Block]]] = {robot: {} for robot in robots}
        self.paths: dict[str, NDArray[np.float64]] = {}
        self.stamp_ns = 0

    def history(self) -> dict[Topic, Handler]:
        """List the topics of which each message counts, with what takes them."""
        found: dict[Topic, Handler] = {}
        for robot in self._robots:
            found[names.ground_truth_pose(robot)] = partial(self._rest, robot)
            found[names.ground_truth_path(robot)] = partial(self._path, robot)
            if robot == names.LEADER:
                found[names.moved(robot)] = partial(self._end, robot)
                continue
            for topic, take in (
                (names.ALIGNMENT, self._state),
                (names.DISPLACEMENT, self._end),
                (names.PREDICTION, self._prediction),
            ):
                found[Topic(names.under(robot, topic.name), topic.type, topic.qos)] = partial(take, robot)
        return found

    def latest(self) -> dict[Topic, Handler]:
        """List the topics of which the latest message is enough, with what takes them."""
        found: dict[Topic, Handler] = {}
        for robot in self._robots:
            found[names.ground_truth_odom(robot)] = partial(self._odometry, robot)
            found[names.joint_states(robot)] = partial(self._joint_states, robot)
        return found

    def pictures(self) -> dict[Topic, Handler]:
        """List the topics of the cameras, with what takes them; of these too the latest message is enough."""
        found: dict[Topic, Handler] = {}
        for robot in self._robots[1:]:
            found[names.camera_image(robot)] = partial(self._image, robot)
            found[Topic(names.under(robot, names.BLOCKS.name), names.BLOCKS.type)] = partial(self._found, robot)
        return found

    def at_present(self) -> Moment:
        """Return what is the case."""
        robots = {
            robot: RobotPose(pose.position_m, pose.orientation, self._joints[robot])
            for robot, pose in self._poses.items()
        }
        return Moment(self.stamp_ns, robots, {robot: self._follower(robot) for robot in self._robots[1:]})

    def picture(self, robot: str) -> tuple[int, Picture] | None:
        """Return the stamp of a follower's latest picture, and the picture with the blocks found in it."""
        if robot not in self._pictures:
            return None
        stamp_ns, picture = self._pictures[robot]
        found = self._blocks[robot]
        # The blocks of this very picture may have been passed over: those before it are as good for a viewer.
        until = max((stamp for stamp in found if stamp <= stamp_ns), default=None)
        return stamp_ns, drawn(picture, [] if until is None else found[until])

    def _follower(self, robot: str) -> FollowerNow:
        return FollowerNow(
            self._states.get(robot, ""), len(self._ends[robot]), self._place(robot), self._forecast(robot)
        )

    def _place(self, robot: str) -> Motion | None:
        neighbour = names.beacon_neighbour(robot)
        if self._delayed:
            ends, finished = self._ends[neighbour], len(self._ends[robot])
            pose = self._resting(neighbour, ends[min(finished, len(ends)) - 1] if finished and ends else 0)
        else:
            now = self._poses.get(neighbour)
            pose = None if now is None else now.planar
        return None if pose is None else pose.then(self._to_place)

    def _forecast(self, robot: str) -> Forecast | None:
        stamp_ns, mean, covariance = self._predictions.get(robot, (0, None, ()))
        start = self._resting(robot, stamp_ns)
        if mean is None or start is None or not mean.finite:
            return None
        # Of (x, y): u is -y, v is x.
        return Forecast(start, mean, (covariance[4], -covariance[1], covariance[0]))

    def _resting(self, robot: str, stamp_ns: int) -> Motion | None:
        """Return where a robot rested at a stamp, or at its start."""
        rests = self._rests[robot]
        index = bisect_right(rests, stamp_ns, key=lambda rest: rest[0])
        return rests[max(0, index - 1)][1] if rests else None

    def _odometry(self, robot: str, message: Message) -> None:
        p, o = message.pose.pose.position, message.pose.pose.orientation
        self._poses[robot] = RobotPose((p.x, p.y, p.z), (o.x, o.y, o.z, o.w))
        self.stamp_ns = max(self.stamp_ns, conversions.stamp_of(message))

    def _joint_states(self, robot: str, message: Message) -> None:
        self._joints[robot] = finite_angles(message.name, message.position)

    def _rest(self, robot: str, message: Message) -> None:
        self._rests[robot].append((conversions.stamp_of(message), conversions.read_pose(message.pose)))
        if robot not in self._poses:  # one that stands since the start tells nothing else
            p, o = message.pose.position, message.pose.orientation
            self._poses[robot] = RobotPose((p.x, p.y, p.z), (o.x, o.y, o.z, o.w))

    def _path(self, robot: str, message: Message) -> None:
        places = [pose.pose.position for pose in message.poses]
        self.paths[robot] = np.array([(p.x, p.y, p.z) for p in places]).reshape(-1, 3)

    def _state(self, robot: str, message: Message) -> None:
        self._states[robot] = message.data

    def _end(self, robot: str, message: Message) -> None:
        self._ends[robot].append(conversions.stamp_of(message))

    def _prediction(self, robot: str, message: Message) -> None:
        mean = conversions.read_displacement(message) if conversions.has_estimate(message) else None
        self._predictions[robot] = (conversions.stamp_of(message), mean, conversions.read_covariance(message))

    def _image(self, robot: str, message: Message) -> None:
        self._pictures[robot] = (conversions.stamp_of(message), conversions.read_image(message))
        self.stamp_ns = max(self.stamp_ns, conversions.stamp_of(message))

    def _found(self, robot: str, message: Message) -> None:
        self._blocks[robot][conversions.stamp_of(message)] = conversions.read_blocks(message)
        while len(self._blocks[robot]) > _KEPT_BLOCKS:
            self._blocks[robot].pop(next(iter(self._blocks[robot])))
