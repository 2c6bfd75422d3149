"""What a follower's camera showed during a recorded run: its pictures with the blocks that were found in them.

A bag of `formation run --images` holds the pictures. For others they are rendered by the world's own camera, from the
true poses, the marker and the ground of the run; they are without noise and flicker.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_formation import names
from robot_formation.bag.errors import BagError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.message_recorder import METADATA_NAME, own_stamp
from robot_formation.viewing.recorded_world import recorded_world, tells_world
from robot_formation.viewing.true_poses import true_poses
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.recorded_messages import read_blocks, read_image
from robot_formation.world.camera import Camera, RenderedPicture
from robot_formation.world.pose import Pose
from robot_formation.world.sensor import Sensor


class CameraView(NamedTuple):
    """A picture, uint8 RGB (rows, columns, 3), and the blocks that the detector found in it."""

    picture: RenderedPicture
    blocks: tuple[Block, ...]


class ReplayedCamera:
    """The camera of one follower in an open bag.

    Attributes:
        robot: the follower.
        rendered: whether pictures are rendered from ground truth; else they are the bag's own.
        stamps_ns: (n,) when the camera took its frames, nanoseconds, in order; never empty.
        known_world: whether the bag tells the world's parameters; else pictures are rendered by the defaults.
    """

    def __init__(self, bag: FormationBag, robot: str) -> None:
        """Look for the follower's pictures, or else for what they are rendered from.

        Args:
            bag: the open bag; it has to stay open.
            robot: the follower's name.

        Raises:
            BagError: there are neither pictures nor ground truth, or the bag is corrupted.
            ParameterError: the bag tells parameters of the world that can't be.
            MessageError: a message of blocks can't be used.
        """
        self.robot = robot
        self._bag = bag
        self._blocks = _blocks(bag, robot)
        self._image = names.camera_image().of(robot)
        self.rendered = self._image not in bag.topics
        self.known_world = True
        if self.rendered:
            self._renderer = _Renderer(bag, robot, next(iter(self._blocks), 0))
            self.known_world = self._renderer.known_world
            self.stamps_ns = np.array(list(self._blocks) or [0], dtype=np.int64)
        else:
            bag.require({self._image: names.camera_image().type})
            self._logged_ns = _logged_stamps(bag, self._image)
            self.stamps_ns = np.array(list(self._logged_ns), dtype=np.int64)
        self._last: tuple[int, RenderedPicture] | None = None

    def view(self, stamp_ns: int) -> CameraView:
        """Return what the camera showed at a stamp.

        A recorded picture is the last one until then, or else the first. A rendered one is of that very stamp; it has
        the blocks of the last frame as long as no robot has moved since, and none while the camera took no frames.

        Raises:
            BagError: the bag is corrupted.
            MessageError: a recorded picture can't be used.
        """
        frame_ns = self._frame_until(stamp_ns)
        if self.rendered:
            same = frame_ns <= stamp_ns and self._renderer.looks_alike(frame_ns, stamp_ns)
            return CameraView(self._renderer.picture(stamp_ns), self._blocks.get(frame_ns, ()) if same else ())
        return CameraView(self._recorded(frame_ns), self._blocks.get(frame_ns, ()))

    def _frame_until(self, stamp_ns: int) -> int:
        return int(self.stamps_ns[max(0, int(np.searchsorted(self.stamps_ns, stamp_ns, side="right")) - 1)])

    def _recorded(self, frame_ns: int) -> RenderedPicture:
        if self._last is None or self._last[0] != frame_ns:
            logged_ns = self._logged_ns[frame_ns]
            for message in self._bag.messages([self._image], logged_ns, logged_ns + 1):
                if _stamp_ns(message.message.header.stamp) == frame_ns:
                    self._last = frame_ns, read_image(message.message)
        if self._last is None or self._last[0] != frame_ns:
            raise BagError(f"{self._bag.path}: the picture of {frame_ns * 1e-9:.3f} s on '{self._image}' is missing")
        return self._last[1]


class _Renderer:
    """Pictures of a follower's camera by the world's own camera and sensor, before noise and flicker."""

    def __init__(self, bag: FormationBag, robot: str, first_frame_ns: int) -> None:
        details = bag.metadata(METADATA_NAME)
        self.known_world = tells_world(details)
        parameters = recorded_world(details, bag.path)
        poses = true_poses(bag, parameters.robots, 10**9 // parameters.state_rate_hz)
        if robot not in poses:
            topics = f"'{names.camera_image().of(robot)}' or '{names.ground_truth_odom(robot).of()}'"
            raise BagError(
                f"{bag.path} has neither pictures nor true poses of {robot}: no topic {topics}; record one of them"
            )
        self._robot, self._poses = robot, poses
        self._frame_ns = 10**9 // parameters.camera.min_frames_per_second
        self._camera = Camera(parameters.make_surface(), parameters)
        self._sensor = Sensor(parameters.camera, parameters.seed, robot)
        self._last: tuple[tuple[Pose, ...], RenderedPicture] | None = None
        # The first frame sets what is not automatic, exposure or white balance.
        self.picture(first_frame_ns)

    def picture(self, stamp_ns: int) -> RenderedPicture:
        """Return the picture of a stamp."""
        poses = self._at(stamp_ns)
        if self._last is None or self._last[0] != poses:
            own, *others = poses
            self._last = poses, self._sensor.develop(self._camera.light(own, others)).picture
        return self._last[1]

    def looks_alike(self, frame_ns: int, stamp_ns: int) -> bool:
        """Return whether a frame shows what a later stamp shows: it is the camera's next, or nothing has moved."""
        return stamp_ns - frame_ns <= self._frame_ns or self._at(frame_ns) == self._at(stamp_ns)

    def _at(self, stamp_ns: int) -> tuple[Pose, ...]:
        """List the pose of the robot, then those of the others."""
        others = (found for robot, found in self._poses.items() if robot != self._robot)
        return (self._poses[self._robot].at(stamp_ns), *(found.at(stamp_ns) for found in others))


def _blocks(bag: FormationBag, robot: str) -> dict[int, tuple[Block, ...]]:
    """Read the blocks of each frame, by its stamp in order; none if they were not recorded."""
    topic = names.BLOCKS.of(robot)
    if topic not in bag.topics:
        return {}
    bag.require({topic: names.BLOCKS.type})
    messages = (message.message for message in bag.messages([topic]))
    found = {_stamp_ns(message.header.stamp): tuple(read_blocks(message)) for message in messages}
    return dict(sorted(found.items()))


def _logged_stamps(bag: FormationBag, topic: str) -> dict[int, int]:
    """Find where in the bag each picture lies: by its own stamp, in order, the stamp that the bag gave it."""
    found = {}
    for message in bag.raw_messages([topic]):
        stamp_ns = own_stamp(message.type_name, message.cdr)
        found[message.stamp_ns if stamp_ns is None else stamp_ns] = message.stamp_ns
    return dict(sorted(found.items()))


def _stamp_ns(stamp: names.Message) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
