"""The world's cost: microseconds per physics step, milliseconds per camera frame against TinyRenderer, in one run.

Physics: robots on the bowl that all drive at once; a real-time factor of 80 for two robots is 52 us per step. Camera: a
robot on the bowl that sees its neighbour, 32 cm away as in formation (its body hides the plate) and 70 cm away (the
plate fills a third of the picture). "full" is drawn anew and exposed, with noise, "standing" is the next frame of a
scene in which nothing has moved. TinyRenderer, PyBullet's own software renderer, draws the same patches of the plate as
a mesh and the same neighbour as four plain bodies, without shadow, segmentation or noise. Each figure is the median
over interleaved rounds of the fastest of some calls.

Run: python bench/world.py [--rounds N]
"""

import argparse
import collections
import math
import statistics
import sys
import time
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from comparison import Comparison, add_comparisons, as_json
from fastest import fastest_ms
from robot_formation.parameters import from_mapping
from robot_formation.surface import Surface, make_surface
from robot_formation.world.bullet import pybullet
from robot_formation.world.camera import Camera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface
from robot_formation.world.scene import PEDESTAL_M, Scene
from robot_formation.world.sensor import Sensor
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World

ROBOTS = (1, 2, 5, 10)
CALLS = 10
DISTANCES_M = (0.32, 0.70)
REAL_TIME_LIMITS = {2: 250.0, 10: 50.0}
"""Aims by number of robots that drive."""


class Drivers:
    """Robots that all drive forward and back."""

    def __init__(self, count: int) -> None:
        parameters = from_mapping(WorldParameters, {"camera": {"mode": "on_demand"}}, where="bench")
        starts = [
            RobotStart(f"robot_{n}", 0.25 + DISTANCES_M[0] * (n % 5), 0.4 + 0.6 * (n // 5), 0.5 * math.pi, camera=False)
            for n in range(count)
        ]
        self.world = World(make_surface("bowl"), starts, parameters, seed=1)
        self._sense = 1.0

    def step_us(self) -> float:
        """Drive once; microseconds per step."""
        for robot in self.world.robots:
            self.world.command(robot, (self._sense * 4.0,) * 4, (6.0,) * 4)
        self._sense = -self._sense
        before, begin = self.world.step_count, time.perf_counter_ns()
        while self.world.advance():
            pass
        return (time.perf_counter_ns() - begin) / 1e3 / (self.world.step_count - before)


class Ours:
    """The camera of this package."""

    def __init__(self, surface: Surface, parameters: WorldParameters, looking: Pose, seen: Pose) -> None:
        self._camera, self._sensor = Camera(surface, parameters), Sensor(parameters.camera, 1, "bench")
        self._looking, self._seen = looking, seen
        self.full()

    def full(self) -> npt.NDArray[np.uint8]:
        """Draw the scene anew, with noise."""
        self._development = self._sensor.develop(self._camera.light(self._looking, [self._seen]))
        return self._sensor.expose(self._development, 0.0)

    def standing(self) -> npt.NDArray[np.uint8]:
        """Give the next frame of the same scene."""
        return self._sensor.expose(self._development, 0.0)


class Tiny:
    """PyBullet's software renderer on the same scene."""

    def __init__(self, surface: Surface, parameters: WorldParameters, looking: Pose, seen: Pose) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        scene = Scene(surface, parameters)
        a, b, c, d = scene.patch_corners.T
        indices = np.concatenate([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
        plate = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=scene.plate_points.tolist(),
            indices=indices.ravel().tolist(),
            rgbaColor=(0.5, 0.5, 0.5, 1),
            physicsClientId=self._client,
        )
        pybullet.createMultiBody(0, -1, plate, physicsClientId=self._client)
        chassis, marker = parameters.chassis, parameters.marker
        foot = marker.top_m - marker.edge_m
        self._box(seen, (chassis.length_m, chassis.width_m), chassis.body_bottom_m, chassis.body_top_m, (0.1, 0.1, 0.1))
        self._box(seen, (PEDESTAL_M,) * 2, chassis.body_top_m, foot, (0.1, 0.1, 0.1))
        self._box(seen, (marker.edge_m,) * 2, foot, marker.top_m, (0.9, 0.1, 0.1))
        self._box(seen, (2 * marker.dot_radius_m,) * 2, marker.top_m, marker.top_m + 0.001, (1, 1, 1))
        camera = parameters.camera
        rotation, lens = Camera(surface, parameters).optical_frame(looking)
        self._view = pybullet.computeViewMatrix(lens, lens + rotation[2], -rotation[1])
        field = math.degrees(2 * math.atan(0.5 * camera.height_px / camera.focal_length_px))
        self._lens = pybullet.computeProjectionMatrixFOV(field, camera.width_px / camera.height_px, camera.near_m, 5.0)
        self._size = (camera.width_px, camera.height_px)

    def _box(
        self, robot: Pose, size: tuple[float, float], bottom: float, top: float, colour: tuple[float, float, float]
    ) -> None:
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=[0.5 * size[0], 0.5 * size[1], 0.5 * (top - bottom)],
            rgbaColor=(*colour, 1),
            physicsClientId=self._client,
        )
        middle = robot.place((0.0, 0.0, 0.5 * (bottom + top)))
        pybullet.createMultiBody(0, -1, shape, middle, robot.orientation, physicsClientId=self._client)

    def full(self) -> npt.NDArray[np.uint8]:
        """Draw the scene."""
        pixels = pybullet.getCameraImage(
            *self._size,
            self._view,
            self._lens,
            renderer=pybullet.ER_TINY_RENDERER,
            shadow=0,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )[2]
        return np.reshape(pixels, (self._size[1], self._size[0], 4))[..., :3]


def comparisons(value: Mapping[int | tuple[float, str], float], step_us: float) -> Iterator[Comparison]:
    """Yield real-time factors beside their limits, and camera frames beside TinyRenderer's."""
    for count, limit in REAL_TIME_LIMITS.items():
        what = f"physics of {count} moving robots"
        yield Comparison(what, step_us / value[count], limit, "times real time", larger_is_better=True)
    for distance in DISTANCES_M:
        what = f"camera frame, neighbour at {100.0 * distance:.0f} cm"
        yield Comparison(what, value[distance, "full"], value[distance, "TinyRenderer"], "ms", "TinyRenderer")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="interleaved rounds (default: 15)")
    add_comparisons(parser)
    args = parser.parse_args()
    rounds = max(1, args.rounds)
    surface, parameters = make_surface("bowl"), WorldParameters()
    looking = pose_on_surface(surface, 1.3, 0.4, 0.5 * math.pi)
    scenes = {}
    for distance in DISTANCES_M:
        seen = pose_on_surface(surface, 1.3 - distance, 0.4, 0.5 * math.pi)
        ours, tiny = Ours(surface, parameters, looking, seen), Tiny(surface, parameters, looking, seen)
        scenes[distance] = {"TinyRenderer": tiny.full, "full": ours.full, "standing": ours.standing}
    drivers = {count: Drivers(count) for count in ROBOTS}
    found: collections.defaultdict[int | tuple[float, str], list[float]] = collections.defaultdict(list)
    for _ in range(rounds):
        for count, driver in drivers.items():
            found[count].append(min(driver.step_us() for _ in range(2)))
        for distance, calls in scenes.items():
            for name, call in calls.items():
                found[distance, name].append(fastest_ms(call, CALLS))
    value = {name: statistics.median(times) for name, times in found.items()}
    if args.comparisons:
        print(as_json(comparisons(value, 1e6 / parameters.physics_hz)))
        return 0
    print(f"{'moving robots':>13} {'us per step':>12} {'real-time factor':>17}")
    for count in ROBOTS:
        print(f"{count:13} {value[count]:12.1f} {1e6 / parameters.physics_hz / value[count]:17.0f}")
    print(f"\n{'camera, neighbour at':>20} {'TinyRenderer ms':>16} {'full ms':>8} {'ratio':>6} ", end="")
    print(f"{'standing ms':>12} {'ratio':>6}")
    for distance in DISTANCES_M:
        theirs, full, standing = (value[distance, name] for name in ("TinyRenderer", "full", "standing"))
        print(
            f"{distance * 100:17.0f} cm {theirs:16.2f} {full:8.3f} {theirs / full:6.1f} "
            f"{standing:12.3f} {full / standing:6.1f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
