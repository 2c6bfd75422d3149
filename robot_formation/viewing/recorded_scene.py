"""A recorded run at any of its times: where robots, places and forecasts are, and what a follower is doing."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.analysis.chain import moves_of_timestep, pose_at_end
from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.from_bag import run_record
from robot_formation.analysis.quantities import analyse
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.geometry.se2 import Motion, formation_error_uv_m
from robot_formation.parameters import suggestion
from robot_formation.viewing.recorded_world import recorded_world
from robot_formation.viewing.true_poses import TruePoses, true_poses


class Forecast(NamedTuple):
    """Where a follower is expected to end its timestep.

    Attributes:
        place: base_link in the world.
        heading_rad: the follower's heading as the forecast was made; its u points to the right of it.
        covariance_uv: (2, 2) of u and v in that heading, m^2.
    """

    place: Motion
    heading_rad: float
    covariance_uv: NDArray[np.float64]


class Corrections(NamedTuple):
    """Summed corrections of a timestep so far, metres."""

    u_m: float
    v_m: float


class RecordedScene:
    """A run out of an open bag, of which one follower is looked at.

    Attributes:
        record: the run's record.
        analysis: its quantities.
        quantities: those of the follower that is looked at.
        world: the world's parameters.
        robots: those with true poses: the leader, then the followers by number.
        follower: the follower that is looked at.
        neighbour: the robot beside which it keeps its place.
        timesteps: as many as the run was to have, or as there are.
        start_ns: the first time of a true pose, nanoseconds.
        end_ns: the last time that a message tells.
    """

    def __init__(self, bag: FormationBag, follower: str) -> None:
        """Read the run.

        Raises:
            BagError: the bag is corrupted, or a topic has another message type than a run's.
            AnalysisError: the bag has no run of this follower, or no true poses.
            ParameterError: it tells parameters of the world that can't be.
        """
        self.record = run_record(bag)
        followers = {found.name: found for found in self.record.followers}
        if follower not in followers:
            raise AnalysisError(f"{bag.path} has no follower '{follower}'{suggestion(follower, followers)}")
        self.follower, self.neighbour = follower, names.beacon_neighbour(follower)
        self._record = followers[follower]
        self.analysis = analyse(self.record)
        self.quantities = next(found for found in self.analysis.followers if found.name == follower)
        self.world = recorded_world(self.record.details, bag.path)
        self._poses = true_poses(bag, [names.LEADER, *followers], 10**9 // self.world.state_rate_hz)
        for robot in (self.neighbour, follower):
            if robot not in self._poses:
                topic = names.ground_truth_odom(robot).of()
                raise AnalysisError(f"{bag.path} has no ground truth of {robot}: no topic '{topic}'; record it too")
        self.robots = list(self._poses)
        self.start_ns = min(int(poses.stamps_ns[0]) for poses in self._poses.values())
        self.end_ns = max(self.start_ns, round(self.record.simulated_s * 1e9))
        # Read once: the record parses the run's details anew each time.
        self._distance_m, self._delayed = self.record.formation_distance_m, self.record.delayed
        self._ends_ns = [displacement.stamp_ns for displacement in self._record.displacements]
        self.timesteps = max(self.record.timesteps_planned or 0, len(self._ends_ns), len(self.record.leader_moved), 1)
        self._moves = [self._corrections_of(t) for t in range(1, len(self._ends_ns) + 2)]

    def poses(self, robot: str) -> TruePoses:
        """Return a robot's true poses."""
        return self._poses[robot]

    def at(self, robot: str, stamp_ns: int) -> Motion:
        """Return a robot's true pose, seen from above."""
        return self._poses[robot].at(stamp_ns).planar

    def way(self, robot: str, stamp_ns: int) -> NDArray[np.float64]:
        """Return the way that a robot has gone, (n, 2) metres in world x and y."""
        poses = self._poses[robot]
        count = int(np.searchsorted(poses.stamps_ns, stamp_ns, side="right"))
        here = self.at(robot, stamp_ns)
        return np.vstack([poses.positions_m[:count, :2], (here.x_m, here.y_m)])

    def finished(self, stamp_ns: int) -> int:
        """Return how many timesteps the follower has finished."""
        return bisect_right(self._ends_ns, stamp_ns)

    def beside(self, stamp_ns: int) -> Motion:
        """Return the pose beside which the follower's place is: its neighbour's, with delayed spacing an older one."""
        if self._delayed:
            before = pose_at_end(self.record, self.neighbour, bisect_left(self._ends_ns, stamp_ns))
            if before is not None:
                return before
        return self.at(self.neighbour, stamp_ns)

    def place(self, stamp_ns: int) -> Motion:
        """Return where in the world the follower's place in formation is."""
        return self.beside(stamp_ns).then(Motion.from_uv(self._distance_m, 0.0))

    def off_place_uv_m(self, pose: Motion, stamp_ns: int) -> tuple[float, float]:
        """Return how far a pose is from the follower's place: (u, v) in its neighbour's frame, metres."""
        return formation_error_uv_m(pose, self.beside(stamp_ns), self._distance_m)

    def forecast(self, stamp_ns: int) -> Forecast | None:
        """Return where the follower is expected to end the timestep; None where nothing is forecast."""
        made = self.finished(stamp_ns)
        if not 0 < made <= min(len(self._record.predictions), self.timesteps - 1):
            return None
        prediction = self._record.predictions[made - 1]
        if not prediction.motion.finite:
            return None
        uu, uv, vv = prediction.covariance_uv
        from_pose = self.at(self.follower, prediction.stamp_ns)
        return Forecast(from_pose.then(prediction.motion), from_pose.yaw_rad, np.array([[uu, uv], [uv, vv]]))

    def corrections(self, timestep: int, stamp_ns: int) -> Corrections:
        """Return what a timestep's corrections have summed up to."""
        done = [move for end_ns, move in self._moves[timestep - 1] if end_ns <= stamp_ns]
        return Corrections(sum(abs(move.u_m) for move in done), sum(abs(move.v_m) for move in done))

    @property
    def timesteps_with_moves(self) -> int:
        """Timesteps that were begun, the last perhaps not finished."""
        return len(self._moves)

    def error_m(self, timestep: int, stamp_ns: int) -> float | None:
        """Return the formation error of a timestep once that is finished; None before, or where it is unknown."""
        finished = timestep <= self.finished(stamp_ns)
        return self.quantities.timesteps[timestep - 1].formation_error_m if finished else None

    def words(self, stamp_ns: int, *, looks: bool) -> str:
        """Return who does what, or how the run has ended.

        Args:
            stamp_ns: when.
            looks: whether the follower's camera has just taken a frame.
        """
        if stamp_ns >= self.end_ns:
            return f"end of the run: {self.analysis.outcome.replace('_', ' ')}"
        moving = [robot for robot in self.robots if self._poses[robot].moves_at(stamp_ns)]
        told = bisect_right(self._record.state_stamps_ns, stamp_ns)
        state = self._record.states[told - 1] if told else ""
        if self.follower in moving:
            return f"{_spoken(self.follower)} moves: {state}" if state else f"{_spoken(self.follower)} moves"
        if moving:
            return f"{', '.join(map(_spoken, moving))} move{'s' if len(moving) == 1 else ''}"
        return f"{_spoken(self.follower)} {'looks' if looks else 'waits'}"

    def _corrections_of(self, timestep: int) -> list[tuple[int, Motion]]:
        """List when each correction of a timestep ended, and its motion."""
        indices = moves_of_timestep(self.record, self._record, timestep)[1:]
        return [(self._record.moved[index].stamp_ns, self._record.moved[index].motion) for index in indices]


def _spoken(robot: str) -> str:
    return robot.replace("_", " ")
