"""Take a run's record out of a bag: the only place where the analysis meets messages."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.analysis.displacement_log import DisplacementLog
from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.run_record import FollowerRecord, Ground, OverheadTrack, RunRecord, Stamped, Track
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.odometry import ODOMETRY_TYPE, Odometry
from robot_formation.bag.reader import read_bag
from robot_formation.bag.source import RawMessage
from robot_formation.geometry.orientation import yaw_rad
from robot_formation.geometry.se2 import Motion
from robot_formation.names import Message
from robot_formation.parameters import suggestion

_TRIANGLE_LIST = 11
_FARTHEST_M = 1e6
_LOGGED = (names.DISPLACEMENT, names.RESIDUAL, names.COMMANDED)
_MOTIONS = (names.MOVED, names.DISPLACEMENT, names.RESIDUAL, names.PREDICTION)


class GroundTruth(NamedTuple):
    """A robot's ground truth, in the order in which it was told.

    Attributes:
        stamps_ns: simulated time (n,), nanoseconds.
        positions_m: x, y, z (n, 3).
        orientations: x, y, z, w (n, 4).
    """

    stamps_ns: NDArray[np.int64]
    positions_m: NDArray[np.float64]
    orientations: NDArray[np.float64]


def load_run(path: str | Path, namespace: str | None = None) -> RunRecord:
    """Read a run's bag, finished or not.

    Args:
        path: the bag.
        namespace: where the formation lies in it, '/' for the root; None: wherever there is one.

    Raises:
        BagError: the bag is missing, no bag, empty or corrupted, or holds several formations.
        AnalysisError: the bag has no run of a formation.
    """
    with read_bag(path) as bag:
        return run_record(FormationBag(bag, namespace))


def run_record(bag: FormationBag) -> RunRecord:
    """Return the record of a run in an open bag.

    Raises:
        BagError: the bag is corrupted, or a topic has another message type than a run's.
        AnalysisError: the bag has no run of a formation.
    """
    robots, messages, stamps, truth = run_messages(bag)
    return record_of(robots, messages, bag.metadata(METADATA_NAME), stamps, truth)


def run_messages(
    bag: FormationBag, beside: Callable[[RawMessage], None] | None = None, topics: Collection[str] = ()
) -> tuple[list[str], dict[str, list[Message]], dict[str, list[int]], dict[str, GroundTruth]]:
    """Read what a run's record is made of: robots, messages by topic, simulated time [ns] of each of these, true poses.

    True poses by robot, where there are any. They are most of a bag, so their messages are not kept.

    Args:
        bag: the open bag.
        beside: takes messages of other topics as they were recorded: reading a long bag twice takes twice as long.
        topics: their names.

    Raises:
        BagError: the bag is corrupted, or a topic has another message type than a run's.
        AnalysisError: the bag has no run of a formation.
    """
    robots = robots_in(bag)
    wanted = run_topics(robots)
    bag.require({topic: type_name for topic, type_name in wanted.items() if topic in bag.topics})
    messages: dict[str, list[Message]] = defaultdict(list)
    stamps: dict[str, list[int]] = defaultdict(list)
    odometry = {topic: Odometry(f"{bag.path}: '{topic}'") for topic in map(_truth_topic, robots)}
    for raw in bag.raw_messages({*wanted, *topics}):
        if raw.topic not in wanted:
            if beside is not None:
                beside(raw)
            continue
        if raw.type_name == ODOMETRY_TYPE:
            odometry[raw.topic].add(raw.cdr)
        else:
            stamps[raw.topic].append(raw.stamp_ns)
            messages[raw.topic].append(bag.bag.decoded(raw).message)
    poses = {robot: GroundTruth(*odometry[_truth_topic(robot)].poses()) for robot in robots}
    return robots, messages, stamps, {robot: found for robot, found in poses.items() if len(found.stamps_ns)}


def _truth_topic(robot: str) -> str:
    return names.ground_truth_odom(robot).of()


def record_of(
    robots: Sequence[str],
    messages: Mapping[str, Sequence[Message]],
    details: Mapping[str, str],
    stamps: Mapping[str, Sequence[int]],
    truth: Mapping[str, GroundTruth],
) -> RunRecord:
    """Return a run's record made from its messages by absolute topic, in order; whoever read them, rosbags or ROS.

    Args:
        robots: the leader, then the followers by number.
        messages: those of the topics that `run_topics` names; topics without messages may be absent.
        details: what the run says of itself.
        stamps: simulated time [ns] of each of these messages, where it is known.
        truth: ground truth by robot, each of one pose at least.
    """
    messages = defaultdict(tuple, messages)
    stamps = defaultdict(list, stamps)
    markers = messages[names.SURFACE.of()]
    latest_ns = [_last_stamp_ns(messages), *(int(poses.stamps_ns[-1]) for poses in truth.values())]
    record = RunRecord(
        leader_moved=_stamped(messages[names.MOVED.of(names.LEADER)]),
        followers=tuple(_follower(robot, messages, stamps) for robot in robots if robot != names.LEADER),
        tracks={robot: _track(poses) for robot, poses in truth.items()},
        simulated_s=max(latest_ns) / 1e9,
        details=details,
        ground=read_ground(markers[-1]) if markers else None,
        left_plate=tuple(message.data for message in messages[names.left_plate().of()]),
    )
    return replace(record, overhead=_overhead(robots, messages, truth, record.dot_height_m))


def load_displacements(path: str | Path, robot: str, namespace: str | None = None) -> DisplacementLog:
    """Read a robot's displacements, residuals and commands, as its predictor got them: paired by their stamps.

    Args:
        path: the bag.
        robot: the robot's name.
        namespace: where its formation lies in the bag, '/' for the root; None: wherever there is one.

    Raises:
        BagError: the bag is missing, no bag, empty or corrupted, it holds several formations, or a topic has another
            message type than a run's.
        AnalysisError: the bag has no displacements of this robot.
    """
    with read_bag(path) as opened:
        bag = FormationBag(opened, namespace)
        topics = {topic.of(robot): topic.type for topic in _LOGGED}
        _require_displacements(bag, robot)
        bag.require({topic: type_name for topic, type_name in topics.items() if topic in bag.topics})
        messages: dict[str, list[Message]] = defaultdict(list)
        for message in bag.messages(topics):
            messages[message.topic].append(message.message)
    if not messages[names.DISPLACEMENT.of(robot)]:
        raise AnalysisError(f"{path} has no displacements of '{robot}'; give the bag of a run with finished timesteps")
    by_stamp = [{entry.stamp_ns: entry.motion for entry in _stamped(messages[topic])} for topic in topics]
    stamps = sorted(by_stamp[0])
    displacements, residuals, commanded = (
        np.array([(found[stamp].u_m, found[stamp].v_m) if stamp in found else (math.nan, math.nan) for stamp in stamps])
        for found in by_stamp
    )
    turns_rad = np.array([by_stamp[0][stamp].yaw_rad for stamp in stamps])
    places = tuple(f"timestep {t}" for t in range(1, len(stamps) + 1))
    return DisplacementLog(str(path), places, displacements, residuals, commanded, turns_rad)


def _require_displacements(bag: FormationBag, robot: str) -> None:
    pattern = re.compile(rf"/([^/]+)/{names.DISPLACEMENT.name}")
    robots = [match[1] for topic in bag.topics if (match := pattern.fullmatch(topic))]
    if not robots:
        raise AnalysisError(
            f"{bag.path} has no displacements: no topic /{names.follower(1)}/{names.DISPLACEMENT.name}; give the bag "
            "of 'formation run' or record that topic"
        )
    if robot not in robots:
        raise AnalysisError(f"{bag.path} has no displacements of '{robot}'{suggestion(robot, robots)}")


def _last_stamp_ns(messages: Mapping[str, Sequence[Message]]) -> int:
    """Return the latest simulated time that a message tells (log times may count on by nanoseconds)."""
    return max(
        (_stamp_ns(group[-1]) for group in messages.values() if group and hasattr(group[-1], "header")), default=0
    )


def robots_in(bag: FormationBag) -> list[str]:
    """Find the robots by their topics: the leader, then the followers by number."""
    topics = "|".join(topic.name for topic in (*_MOTIONS, names.ALIGNMENT))
    found = {match[1] for topic in bag.topics if (match := re.fullmatch(rf"/follower_([1-9]\d*)/(?:{topics})", topic))}
    if not found:
        raise AnalysisError(
            f"{bag.path} has no formation run: no topic /{names.follower(1)}/{names.MOVED.name} and the like; "
            "give the bag of 'formation run' or record all topics"
        )
    return [names.LEADER, *(names.follower(number) for number in sorted(int(number) for number in found))]


def run_topics(robots: Sequence[str]) -> dict[str, str]:
    """List the topics that the analysis reads, with their message types."""
    topics = {topic.of(): topic.type for topic in (names.SURFACE, names.left_plate(), names.OVERHEAD_POSES)}
    for robot in robots:
        odom = names.ground_truth_odom(robot)
        topics[odom.of()] = odom.type
        topics.update({topic.of(robot): topic.type for topic in (*_MOTIONS, names.MOVE, names.ALIGNMENT)})
    return topics


def _follower(
    robot: str, messages: Mapping[str, Sequence[Message]], stamps: Mapping[str, Sequence[int]]
) -> FollowerRecord:
    moved, displacements, residuals, predictions = (_stamped(messages[topic.of(robot)]) for topic in _MOTIONS)
    states = names.ALIGNMENT.of(robot)
    return FollowerRecord(
        robot,
        moved,
        displacements,
        _with_known_turns(residuals),
        _with_known_turns(predictions),
        states=tuple(message.data for message in messages[states]),
        state_stamps_ns=tuple(stamps[states]),
        commands=tuple(_motion(message.pose) for message in messages[names.MOVE.of(robot)]),
    )


def _stamped(messages: Sequence[Message]) -> tuple[Stamped, ...]:
    """Turn PoseWithCovarianceStamped messages into stamped displacements; NaN where a negative variance says 'none'."""
    none = Motion(math.nan, math.nan)
    return tuple(
        Stamped(
            _stamp_ns(message),
            _motion(message.pose.pose),
            _covariance_uv(message.pose.covariance),
            float(message.pose.covariance[35]),
        )
        if message.pose.covariance[0] >= 0.0
        else Stamped(_stamp_ns(message), none, turn_variance=-1.0)
        for message in messages
    )


def _with_known_turns(found: tuple[Stamped, ...]) -> tuple[Stamped, ...]:
    """Tell a turn that is known from one that older runs left out: they gave no variance, and a turn only if known."""
    return tuple(
        replace(entry, turn_variance=-1.0) if entry.turn_variance == 0.0 and entry.motion.yaw_rad == 0.0 else entry
        for entry in found
    )


def _covariance_uv(covariance: Message) -> tuple[float, float, float]:
    """Turn a message's covariance, whose first two axes are x = v and y = -u, into those of (u, u), (u, v), (v, v)."""
    return (float(covariance[7]), -float(covariance[1]), float(covariance[0]))


def _stamp_ns(message: Message) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _motion(pose: Message) -> Motion:
    return Motion(float(pose.position.x), float(pose.position.y), _yaw(pose.orientation))


def _yaw(quaternion: Message) -> float:
    return yaw_rad((quaternion.x, quaternion.y, quaternion.z, quaternion.w))


def _track(poses: GroundTruth) -> Track:
    """Turn poses into a true path, in order of their stamps."""
    order = np.argsort(poses.stamps_ns, kind="stable")
    # One by one: a long run's poses as a list would take 200 bytes each.
    yaws = np.fromiter((yaw_rad(turn.tolist()) for turn in poses.orientations), float, len(order))
    tilts = _ups(poses.orientations)[:, :2]
    return Track(poses.stamps_ns[order], poses.positions_m[order], yaws[order], tilts[order])


def _overhead(
    robots: Sequence[str],
    messages: Mapping[str, Sequence[Message]],
    truth: Mapping[str, GroundTruth],
    dot_height_m: float,
) -> dict[str, OverheadTrack]:
    """Compare where the tracker saw each robot's dot with the dot's true places.

    The tracker tells the places of all robots after each picture, in their order. One that it doesn't see keeps its
    place to the last bit; one that it sees never does, since pictures are noisy. The first place that it tells may be
    where it was told that the robot starts: it counts only if the second picture has changed it. A robot that is never
    seen has no track.
    """
    told = sorted(messages[names.OVERHEAD_POSES.of()], key=_stamp_ns)
    told = [message for message in told if len(message.poses) == len(robots)]
    tracks = {}
    for number, robot in enumerate(robots):
        poses = truth.get(robot)
        if not told or poses is None:
            continue
        places = np.array([_place(message.poses[number].position) for message in told])
        moved = np.append(False, np.any(places[1:] != places[:-1], axis=1))
        if not moved.any():
            continue
        moved[0] = moved[1]
        stamps = np.array([_stamp_ns(message) for message in told], dtype=np.int64)[moved]
        seen = places[moved]
        order = np.argsort(poses.stamps_ns, kind="stable")
        # A robot that stands says nothing, so its last word before the picture holds.
        index = np.searchsorted(poses.stamps_ns[order], stamps, side="right") - 1
        known = index >= 0
        entries = order[index[known]]
        dots = _dots(poses.positions_m[entries], poses.orientations[entries], dot_height_m)
        tracks[robot] = OverheadTrack(stamps[known], seen[known].reshape(-1, 3), dots.reshape(-1, 3))
    return tracks


def _place(point: Message) -> tuple[float, float, float]:
    return (float(point.x), float(point.y), float(point.z))


def _ups(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the directions (n, 3) of the z axes of bodies of orientations (n, 4), unit vectors."""
    x, y, z, w = turns.T
    return np.column_stack([2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)])


def _dots(places_m: NDArray[np.float64], turns: NDArray[np.float64], height_m: float) -> NDArray[np.float64]:
    """Return the places (n, 3) of a robot's dot, which is on the z axis of its base_link, at poses (n, 3), (n, 4)."""
    up = _ups(turns)
    return places_m + height_m * up


def read_ground(marker: Message) -> Ground | None:
    """Turn a TRIANGLE_LIST marker, unrotated in the world frame, into a mesh with shared vertices.

    None for others, and for one whose corners aren't numbers of a ground's size.
    """
    if marker.type != _TRIANGLE_LIST or len(marker.points) < 3:
        return None
    corners = np.array([(point.x, point.y, point.z) for point in marker.points])
    scale = np.array([marker.scale.x, marker.scale.y, marker.scale.z])
    origin = marker.pose.position
    with np.errstate(over="ignore", invalid="ignore"):  # any numbers
        corners = corners * scale + (origin.x, origin.y, origin.z)
    if not (np.abs(corners) < _FARTHEST_M).all():
        return None
    vertices, numbers = np.unique(corners.round(6), axis=0, return_inverse=True)
    count = len(corners) // 3
    return Ground(vertices, numbers.reshape(-1)[: 3 * count].reshape(count, 3))
