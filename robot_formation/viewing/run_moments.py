"""A recorded run at any of its instants."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.analysis.chain import pose_at_end
from robot_formation.analysis.from_bag import record_of, robots_in, run_messages
from robot_formation.analysis.quantities import RunAnalysis, analyse
from robot_formation.analysis.run_record import FollowerRecord
from robot_formation.bag.errors import BagError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.source import RawMessage
from robot_formation.geometry.se2 import Motion
from robot_formation.viewing.lens import Lens, read_lens
from robot_formation.viewing.moment import FollowerNow, Moment, RobotNow, ShownForecast, TimestepFigures, finite_angles
from robot_formation.viewing.robot_shape import read_shape
from robot_formation.viewing.true_poses import TruePoses

_POSE_PERIOD_NS = 100_000_000
"""Poses of one motion are not farther apart; the world's are a twentieth of a second."""


class RunMoments:
    """A run in an open bag.

    Attributes:
        record: what the analysis reads.
        shapes: links of each robot.
        lenses: of each follower's camera, where the bag tells it.
        start_ns: simulated time of the first true pose.
        end_ns: of the last one, or of what a follower said last.
    """

    def __init__(self, bag: FormationBag) -> None:
        """Read the run, but neither wheels nor pictures yet.

        Raises:
            BagError: the bag is corrupted, a topic has another message type than a run's, or there are no true poses.
            AnalysisError: the bag has no run of a formation.
        """
        self._bag = bag
        self._beside = {topic: list[RawMessage]() for topic in self._topics_beside(robots_in(bag))}
        robots, messages, stamps, truth = run_messages(
            bag, lambda raw: self._beside[raw.topic].append(raw), self._beside
        )
        self.record = record_of(robots, messages, bag.metadata(METADATA_NAME), stamps, truth)
        self._poses = {robot: TruePoses(*found, period_ns=_POSE_PERIOD_NS) for robot, found in truth.items()}
        if not self._poses:
            topic = names.ground_truth_odom(names.LEADER).of()
            raise BagError(f"{bag.path} tells no true poses, which a view is made of; record '{topic}' and the like")
        self.shapes = {robot: read_shape(self._text(names.robot_description(robot).of())) for robot in self._poses}
        lenses = {robot: self._lens(names.camera_info(robot).of()) for robot in self._poses}
        self.lenses = {robot: lens for robot, lens in lenses.items() if lens is not None}
        self.start_ns = min(int(found.stamps_ns[0]) for found in self._poses.values())
        ends = [int(found.stamps_ns[-1]) for found in self._poses.values()]
        ends += [follower.state_stamps_ns[-1] for follower in self.record.followers if follower.state_stamps_ns]
        self.end_ns = max(ends)

    @property
    def title(self) -> str:
        """What was run, for people."""
        details = self.record.details
        parts = [details.get("scenario") or "formation run", details.get("predictor", ""), details.get("surface", "")]
        parts.append(f"seed {details['seed']}" if details.get("seed") else "")
        return " · ".join(part for part in parts if part)

    @property
    def robots(self) -> list[str]:
        """Robots with true poses, the leader first."""
        return list(self._poses)

    @cached_property
    def analysis(self) -> RunAnalysis:
        """The run's quantities."""
        return analyse(self.record)

    @cached_property
    def figures(self) -> dict[str, tuple[TimestepFigures, ...]]:
        """Each follower's finished timesteps."""
        return {
            follower.name: tuple(
                TimestepFigures(t.t, t.corrections.u_m + t.corrections.v_m, t.formation_error_m)
                for t in follower.timesteps
            )
            for follower in self.analysis.followers
        }

    def path(self, robot: str, most: int = 2000) -> NDArray[np.float64]:
        """Return a robot's path (n, 3), metres, thinned to so many places."""
        places = self._poses[robot].positions_m
        chosen = np.unique(np.linspace(0, len(places) - 1, min(most, len(places))).round().astype(int))
        return np.asarray(places[chosen], float)

    def instants(self, most: int, period_ns: int = _POSE_PERIOD_NS) -> list[int]:
        """List instants from the run's start to its end at which a moving robot is to be shown: at most so many."""
        return list(range(self.start_ns, self.end_ns + 1, max(period_ns, self.duration_ns // most)))

    @property
    def duration_ns(self) -> int:
        """Simulated time from start to end."""
        return self.end_ns - self.start_ns

    def at(self, stamp_ns: int) -> Moment:
        """Return what is the case at an instant."""
        robots = {}
        for robot, poses in self._poses.items():
            pose = poses.at(stamp_ns)
            robots[robot] = RobotNow(pose.position, pose.orientation, self._joints[robot].at(stamp_ns))
        return Moment(stamp_ns, robots, {f.name: self._follower(f, stamp_ns) for f in self.record.followers})

    @cached_property
    def _joints(self) -> dict[str, _Joints]:
        return {robot: _Joints(self._beside[names.joint_states(robot).of()], self._bag) for robot in self._poses}

    def _topics_beside(self, robots: Sequence[str]) -> dict[str, str]:
        """List the topics that only a view needs, with their types; those that the bag has must be of these.

        Raises:
            BagError: one is of another type.
        """
        topics = [
            kind(robot) for kind in (names.robot_description, names.camera_info, names.joint_states) for robot in robots
        ]
        found = {topic.of(): topic.type for topic in topics}
        self._bag.require({topic: kind for topic, kind in found.items() if topic in self._bag.topics})
        return found

    def _follower(self, follower: FollowerRecord, stamp_ns: int) -> FollowerNow:
        states = int(np.searchsorted(follower.state_stamps_ns, stamp_ns, side="right"))
        finished = _count([d.stamp_ns for d in follower.displacements], stamp_ns)
        place = self._place(follower.name, finished, stamp_ns)
        return FollowerNow(
            follower.states[states - 1] if states else "", finished, place, self._forecast(follower, stamp_ns)
        )

    def _place(self, robot: str, finished: int, stamp_ns: int) -> Motion | None:
        neighbour = names.beacon_neighbour(robot)
        if self.record.delayed:
            pose = pose_at_end(self.record, neighbour, finished)
        else:
            track = self.record.tracks.get(neighbour)
            pose = None if track is None else track.at(stamp_ns)
        return None if pose is None else pose.then(self.record.place(robot))

    def _forecast(self, follower: FollowerRecord, stamp_ns: int) -> ShownForecast | None:
        count = _count([prediction.stamp_ns for prediction in follower.predictions], stamp_ns)
        track = self.record.tracks.get(follower.name)
        told = follower.predictions[count - 1] if count else None
        start = None if track is None or told is None else track.at(told.stamp_ns)
        if told is None or start is None or not told.motion.finite:
            return None
        return ShownForecast(start, told.motion, told.covariance_uv)

    def _text(self, topic: str) -> str:
        messages = self._beside[topic]
        return str(self._bag.bag.decoded(messages[-1]).message.data) if messages else ""

    def _lens(self, topic: str) -> Lens | None:
        messages = self._beside[topic]
        return read_lens(self._bag.bag.decoded(messages[-1]).message) if messages else None


class _Joints:
    """Angles of a robot's joints, decoded when they are asked for: a long run has tens of thousands."""

    def __init__(self, messages: Sequence[RawMessage], bag: FormationBag) -> None:
        self._messages, self._bag = messages, bag.bag
        self._stamps_ns = np.array([message.stamp_ns for message in messages], dtype=np.int64)
        self._last = (-1, dict[str, float]())

    def at(self, stamp_ns: int) -> dict[str, float]:
        """Return the angles by joint, radians, that were told last; none before the first."""
        index = int(np.searchsorted(self._stamps_ns, stamp_ns, side="right")) - 1
        if index != self._last[0]:
            self._last = index, self._decoded(index) if index >= 0 else {}
        return self._last[1]

    def _decoded(self, index: int) -> dict[str, float]:
        message = self._bag.decoded(self._messages[index]).message
        return finite_angles(message.name, message.position)


def _count(stamps_ns: Sequence[int], until_ns: int) -> int:
    """Return how many stamps there are until an instant."""
    return int(np.searchsorted(np.asarray(stamps_ns, dtype=np.int64), until_ns, side="right"))
