"""The grid of the camera's calibration: where the follower is placed, and what its camera reports there.

Paper, "Visual fine-tuning process calibrations": every 5 cm of -45..45 cm along u and v, at nine relative angles. Two
finer sets are looked at besides, parallel to the neighbour, because the fine-tuning window of 6 cm holds only one point
of that grid: along v at each distance, and along u straight beside the neighbour.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from robot_formation.calibration.alignment_trial import FOLLOWER, Start, gap_m, poses
from robot_formation.calibration.camera_edge_bias import Corners
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.components.node_parameters import BlockDetectorNodeParameters, WorldNodeParameters
from robot_formation.drive.curves import CalibrationError
from robot_formation.follower.fine_tuning import LookParameters
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.scaling import scaled
from robot_formation.world.camera import Camera
from robot_formation.world.pose import Pose
from robot_formation.world.sensor import Sensor

REACH_M = 0.45
ANGLES_DEG = (-60.0, -45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0, 60.0)
FINER = 10
"""Steps of the finer sets in one of the grid's."""
FINE_REACH_M = 0.1
"""Farthest v of the finer set along v."""
_FINEST = 45
_DIGITS = 6


# Left and right edge of each face as seen from outside: forward and to the left of the marker's middle, in half edges.
_FACE_SIDES = {Face.TARGET: ((-1, -1), (1, -1)), Face.FRONT: ((1, -1), (1, 1)), Face.REAR: ((-1, 1), (-1, -1))}


@dataclass(frozen=True)
class Position:
    """A place (u, v) [m] of the follower and the relative angles [deg, clockwise] that it is turned to there."""

    u_m: float
    v_m: float
    angles_deg: tuple[float, ...]


@dataclass(frozen=True)
class Conditions:
    """What all looks of a calibration have in common; hashable, so that workers keep their equipment."""

    world: WorldNodeParameters
    detector: BlockDetectorNodeParameters
    look: LookParameters
    seed: int


def positions(step_m: float, width_m: float) -> list[Position]:
    """List all positions: the paper's grid by u, then v, then what the finer sets add.

    Args:
        step_m: of the grid; a whole number of steps must make 45 cm.
        width_m: of a robot: parallel robots closer than that touch.

    Raises:
        CalibrationError: if the step doesn't fit.
    """
    count = round(REACH_M / step_m) if math.isfinite(step_m) and step_m > 0.0 else 0
    if not 1 <= count <= _FINEST or not math.isclose(count * step_m, REACH_M):
        raise CalibrationError(
            f"a step of {step_m:g} m doesn't divide the grid's {REACH_M} m into whole steps of 0.01 m or more; take "
            "0.05 (the paper's), 0.09, 0.15, ..."
        )
    axis = [_metres(k * REACH_M / count) for k in range(-count, count + 1)]
    found = {(u, v): Position(u, v, ANGLES_DEG) for u in axis for v in axis}
    fine = REACH_M / count / FINER
    beside = [u for u in axis if u > width_m]
    reach = math.floor(FINE_REACH_M / fine + 1e-9)
    for u in beside:
        for k in range(-reach, reach + 1):
            v = _metres(k * fine)
            found.setdefault((u, v), Position(u, v, (0.0,)))
    for k in range(1, FINER * count + 1):
        u = _metres(k * fine)
        if u > width_m:
            found.setdefault((u, 0.0), Position(u, 0.0, (0.0,)))
    return list(found.values())


def measure(position: Position, conditions: Conditions) -> list[CameraSample]:
    """Look once at each angle of a position.

    The noise depends on seed and position only, so the order of positions and the number of workers don't matter.
    """
    bench = _bench(conditions.world, conditions.detector)
    sensor = Sensor(conditions.world.camera, conditions.seed, f"{FOLLOWER} at {position.u_m} {position.v_m}")
    return [bench.look(sensor, position, angle, conditions.look) for angle in position.angles_deg]


def stand(world: WorldNodeParameters, u_m: float, v_m: float, clockwise_deg: float) -> tuple[Pose, Pose]:
    """Return the poses of neighbour and follower, about the plate's middle."""
    return _bench(world, None).stand(u_m, v_m, clockwise_deg)


def true_faces(world: WorldNodeParameters, sample: CameraSample) -> dict[Face, Corners]:
    """Project the corners of the neighbour's marker faces, by signature, as `edge_biases` takes them.

    Faces that reach behind the lens are left out.
    """
    return _bench(world, None).faces(sample)


class _Bench:
    """Ground, camera and detector; made once per process."""

    def __init__(self, world: WorldNodeParameters, detector: BlockDetectorNodeParameters | None) -> None:
        self._world = world
        self._surface = world.make_surface()
        self._camera = Camera(self._surface, world)
        self._detector = BlockDetector(detector.load(), detector) if detector is not None else None

    def stand(self, u_m: float, v_m: float, clockwise_deg: float) -> tuple[Pose, Pose]:
        leader, follower = poses(self._surface, Start(u_m, v_m, clockwise_deg))
        return leader.pose(self._surface, self._world), follower.pose(self._surface, self._world)

    def faces(self, sample: CameraSample) -> dict[Face, Corners]:
        leader, follower = self.stand(sample.u_m, sample.v_m, sample.clockwise_deg)
        rotation, lens = self._camera.optical_frame(follower)
        marker = self._world.marker
        half, heights = marker.edge_m / 2.0, (marker.top_m, marker.top_m - marker.edge_m)
        found = {}
        for face, sides in _FACE_SIDES.items():
            corners = np.array([leader.place((x * half, y * half, z)) for x, y in sides for z in heights])
            if np.all((corners - lens) @ rotation[2] > self._world.camera.near_m):
                found[face] = self._camera.project(follower, corners)
        return found

    def look(self, sensor: Sensor, position: Position, angle: float, look: LookParameters) -> CameraSample:
        leader, follower = self.stand(position.u_m, position.v_m, angle)
        chassis = self._world.chassis
        if gap_m(leader, follower, chassis.length_m, chassis.width_m) <= 0.0:
            return CameraSample(position.u_m, position.v_m, angle, attainable=False)
        development = sensor.develop(self._camera.light(follower, [leader]))
        rate = self._world.camera.min_frames_per_second
        detector = self._detector
        assert detector is not None  # only `stand` does without
        detector.reset()

        def frames() -> Iterator[tuple[Block, ...]]:
            number = 0
            while True:
                number += 1
                picture = sensor.expose(development, number / rate)
                yield tuple(detector.process(scaled(picture), number * 10**6 // rate))

        reports = _until_steady(frames(), look)
        return CameraSample(position.u_m, position.v_m, angle, True, len(reports), reports[-1])


@lru_cache(maxsize=4)
def _bench(world: WorldNodeParameters, detector: BlockDetectorNodeParameters | None) -> _Bench:
    return _Bench(world, detector)


def _until_steady(frames: Iterator[tuple[Block, ...]], look: LookParameters) -> Sequence[tuple[Block, ...]]:
    """Return the frames that the fine-tuner requests: a look's number, and more while the last ones differ."""
    reports = [next(frames) for _ in range(look.frames)]
    for _ in range(look.max_extensions):
        kinds = [
            sorted((block.signature, block.index) for block in blocks) for blocks in reports[-look.stable_frames :]
        ]
        if all(kind == kinds[0] for kind in kinds):
            break
        reports += [next(frames) for _ in range(look.extra_frames)]
    return reports


def _metres(value: float) -> float:
    """Round away what binary fractions leave over: places are compared and written as decimals."""
    return round(value, _DIGITS) + 0.0
