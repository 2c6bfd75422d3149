"""One alignment from any start, without a predictor: world, drive, detector and fine-tuner on a short loop."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from robot_formation import names
from robot_formation.alignment.precise.motion_planner import count_legs
from robot_formation.components.node_parameters import BlockDetectorNodeParameters
from robot_formation.drive.movement_system import Drive, DriveParameters
from robot_formation.follower.actions import Action, Done, Lost, RequestFrames, SendMove
from robot_formation.follower.alignment_state import AlignmentState, State
from robot_formation.follower.fine_tuning import FineTuner, FineTunerParameters
from robot_formation.geometry.footprint import footprint_gap_m
from robot_formation.geometry.se2 import Motion, formation_error_uv_m
from robot_formation.surface import Surface
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.picture import Picture
from robot_formation.world.events import Frame, JointStates, RobotPose
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.start import RobotStart

FOLLOWER = names.follower(1)
HEADING_RAD = math.pi / 2.0
_PUSHED_M = 5e-4
_OUTCOMES = [state.value for state in (AlignmentState.ALIGNED, AlignmentState.UNALIGNED, AlignmentState.LOST)]


@dataclass(frozen=True)
class Start:
    """Where a follower stands relative to its neighbour: u to the right and v ahead in its frame [m], angle clockwise
    from its heading [deg].
    """

    u_m: float
    v_m: float
    angle_deg: float


@dataclass(frozen=True)
class SeenFrame:
    """The detector's blocks of one frame, and when its picture was taken [ns]."""

    blocks: Sequence[Block]
    stamp_ns: int


@dataclass(frozen=True)
class Equipment:
    """What all trials have in common."""

    surface: Surface
    world: WorldParameters
    drive: DriveParameters
    detector: BlockDetectorNodeParameters
    fine_tuner: FineTunerParameters


@dataclass
class Trial:
    """How an alignment went: outcome (aligned, unaligned or lost), moves (axes count apart) and way, final error.

    Attributes:
        errors: u, v [m] in the neighbour's frame and heading [rad], by ground truth.
    """

    start: Start
    outcome: str = ""
    moves: int = 0
    commands: int = 0
    path_m: float = 0.0
    touched: bool = False
    errors: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    states: list[str] = field(default_factory=list)


def poses(surface: Surface, start: Start) -> tuple[RobotStart, RobotStart]:
    """Place the leader so that the pair stands about the plate's middle, and the follower as the start says."""
    c, s = math.cos(HEADING_RAD), math.sin(HEADING_RAD)
    dx, dy = c * start.v_m + s * start.u_m, s * start.v_m - c * start.u_m
    middle = 0.5 * surface.size_m
    x, y = middle - 0.5 * dx, middle - 0.5 * dy
    heading = HEADING_RAD - math.radians(start.angle_deg)
    return RobotStart(names.LEADER, x, y, HEADING_RAD, camera=False), RobotStart(FOLLOWER, x + dx, y + dy, heading)


class AlignmentTrial:
    """Runs one trial.

    Args:
        equipment: world, drive, detector and fine-tuner.
        start: where the follower begins.
        seed: of every random stream.
        tamper: stands between detector and fine-tuner: takes a frame, returns the frames that arrive now.
        spoil: stands between camera and detector: takes a picture and the number of the frame, returns a picture.
    """

    def __init__(
        self,
        equipment: Equipment,
        start: Start,
        seed: int,
        tamper: Callable[[SeenFrame], Sequence[SeenFrame]] | None = None,
        spoil: Callable[[Picture, int], Picture] | None = None,
    ) -> None:
        from robot_formation.world.world import World  # needs PyBullet, the rest of this file doesn't

        self._world = World(equipment.surface, poses(equipment.surface, start), equipment.world, seed=seed)
        self._drive = Drive(equipment.drive)
        self._detector = BlockDetector(equipment.detector.load(), equipment.detector)
        self._tuner = FineTuner(equipment.fine_tuner)
        self._place = equipment.fine_tuner.place
        self._tamper = tamper
        self._spoil = spoil
        self._frames = 0
        self._actions: deque[Action] = deque()
        self._chassis = equipment.world.chassis
        self._leader = self._world.ground_truth(names.LEADER).pose
        self.trial = Trial(start)

    def run(self) -> Trial:
        """Align once, to the tick of timestep 0 or until the leader is lost."""
        try:
            self._actions.extend(self._tuner.neighbour_done(0))
            while self._actions:
                if self._act(self._actions.popleft()):
                    break
                if not self._actions:
                    self._actions.extend(self._tuner.stalled())
            self._judge()
        finally:
            self._world.close()
        return self.trial

    def _act(self, action: Action) -> bool:
        """Carry out an action; True at the end."""
        match action:
            case SendMove(motion):
                self.trial.moves += count_legs(motion)
                self.trial.commands += 1
                self._move(motion)
            case RequestFrames(count):
                self._look(count)
            case State():
                self.trial.states.append(action.text)
            case Lost() | Done():
                return True
            case _:
                pass
        return False

    def _move(self, motion: Motion) -> None:
        world = self._world
        joints = world.joint_states(FOLLOWER)
        self._drive.joint_states(world.stamp_ns, joints.positions, (0.0,) * 6)
        action = self._drive.move(motion)
        while action.command is not None:
            world.command(FOLLOWER, action.command.angles_rad, action.command.limits_rad_s)
            final = None
            while events := world.advance():
                for event in events:
                    if isinstance(event, JointStates) and event.robot == FOLLOWER and event.final:
                        final = event
                    elif isinstance(event, RobotPose):
                        self._watch()
            if final is None:
                raise RuntimeError("the follower didn't come to rest")
            action = self._drive.joint_states(final.stamp_ns, final.positions, final.velocities)
        assert action.moved is not None
        self.trial.path_m += math.hypot(action.moved.x_m, action.moved.y_m)
        self._actions.extend(self._tuner.moved(action.moved, world.stamp_ns))

    def _look(self, count: int) -> None:
        self._world.request_frames(FOLLOWER, count)
        while events := self._world.advance():
            for event in events:
                if not isinstance(event, Frame):
                    continue
                picture = event.image if self._spoil is None else self._spoil(event.image, self._frames)
                self._frames += 1
                seen = SeenFrame(self._detector.process(picture, event.stamp_ns // 1000), event.stamp_ns)
                for frame in [seen] if self._tamper is None else self._tamper(seen):
                    self._actions.extend(self._tuner.frame(frame.blocks, frame.stamp_ns))

    def _watch(self) -> None:
        """Note a touch: the bodies overlap, or the standing leader has been pushed."""
        leader = self._world.ground_truth(names.LEADER).pose
        follower = self._world.ground_truth(FOLLOWER).pose
        pushed = math.dist(leader.position, self._leader.position) > _PUSHED_M
        if pushed or gap_m(leader, follower, self._chassis.length_m, self._chassis.width_m) <= 0.0:
            self.trial.touched = True

    def _judge(self) -> None:
        words = [word for state in self.trial.states if (word := state.partition(":")[0]) in _OUTCOMES]
        self.trial.outcome = words[-1] if words else "lost"
        leader = self._world.ground_truth(names.LEADER).pose
        follower = self._world.ground_truth(FOLLOWER).pose
        yaw = math.remainder(follower.yaw_rad - leader.yaw_rad, math.tau)
        self.trial.errors = (*formation_error_uv_m(follower.planar, leader.planar, self._place), yaw)


def gap_m(a: Pose, b: Pose, length_m: float, width_m: float) -> float:
    """Distance of two bodies, seen from above, along their best separating axis; negative if they overlap."""
    return footprint_gap_m(b.planar.relative_to(a.planar), length_m, width_m)
