"""Where a robot truly was at any time of a recorded run, in all six degrees of freedom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.odometry import Odometry
from robot_formation.world.pose import Pose


class TruePoses:
    """Poses of a robot's base_link in the world.

    Attributes:
        stamps_ns: (n,) nanoseconds, in order.
        positions_m: (n, 3) x, y, z.
        orientations: (n, 4) unit quaternions x, y, z, w.
    """

    def __init__(
        self,
        stamps_ns: NDArray[np.int64],
        positions_m: NDArray[np.float64],
        orientations: NDArray[np.float64],
        *,
        period_ns: int,
    ) -> None:
        """Take poses in any order, at least one.

        Args:
            stamps_ns: see the attributes.
            positions_m: alike.
            orientations: alike.
            period_ns: longest time between two poses of a motion. A robot that stands tells none.
        """
        self._period_ns = period_ns
        order = np.argsort(stamps_ns, kind="stable")
        self.stamps_ns, self.positions_m, self.orientations = stamps_ns[order], positions_m[order], orientations[order]

    def at(self, stamp_ns: int) -> Pose:
        """Return the pose at a stamp: between two poses of a motion on the line between them, else the last one.

        Before the first pose it is the first one. The beginning of a motion counts as rest, until its first pose.
        """
        index = max(0, int(np.searchsorted(self.stamps_ns, stamp_ns, side="right")) - 1)
        position, orientation = self.positions_m[index], self.orientations[index]
        if index + 1 < len(self.stamps_ns):
            before, after = int(self.stamps_ns[index]), int(self.stamps_ns[index + 1])
            if before < stamp_ns and after - before <= self._period_ns:
                share = (stamp_ns - before) / (after - before)
                position = position + share * (self.positions_m[index + 1] - position)
                orientation = _between(orientation, self.orientations[index + 1], share)
        x, y, z, w = orientation.tolist()
        return Pose((float(position[0]), float(position[1]), float(position[2])), (x, y, z, w))

    def moves_at(self, stamp_ns: int) -> bool:
        """Return whether the robot is in a motion."""
        index = int(np.searchsorted(self.stamps_ns, stamp_ns, side="left"))
        if not 0 < index < len(self.stamps_ns):
            return False
        return int(self.stamps_ns[index] - self.stamps_ns[index - 1]) <= self._period_ns


def _between(one: NDArray[np.float64], other: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Turn from one orientation by a share of the small way to another."""
    mixed = one + share * (np.copysign(1.0, one @ other) * other - one)
    return np.asarray(mixed / np.linalg.norm(mixed))


def true_poses(bag: FormationBag, robots: Sequence[str], period_ns: int) -> dict[str, TruePoses]:
    """Read the true poses of robots; those that the bag has none of are left out.

    Args:
        bag: the open bag.
        robots: their names.
        period_ns: as for `TruePoses`.

    Raises:
        BagError: the bag is corrupted, or a topic has another message type.
    """
    topics = {names.ground_truth_odom(robot).of(): robot for robot in robots}
    there = [topic for topic in topics if topic in bag.topics]
    bag.require({topic: names.ground_truth_odom(topics[topic]).type for topic in there})
    odometry = {topics[topic]: Odometry(f"{bag.path}: '{topic}'") for topic in there}
    for raw in bag.raw_messages(there):
        odometry[topics[raw.topic]].add(raw.cdr)
    poses = {robot: found.poses() for robot, found in odometry.items()}
    return {robot: TruePoses(*found, period_ns=period_ns) for robot, found in poses.items() if len(found[0])}
