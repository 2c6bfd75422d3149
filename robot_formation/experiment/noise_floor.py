"""The noise floor of a run: the same controller, but its prediction moves are the ideal ones, by ground truth.

What is left for the camera to correct then comes from the robot's own scatter and the camera's noise. `ideal` commands
the ideal move itself, `ideal+close` takes off the actuation bias as the project's predictor has learned it in the same
run. The camera's systematic error is part of what ideal means, since the fine-tuner corrects until the
camera's tolerance is met.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable

import numpy as np

from robot_formation import conversions, names
from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.components.predictor import PredictorComponent
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.scenario import Scenario
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.geometry.slots import slot
from robot_formation.names import Message
from robot_formation.world.camera import Camera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface

_ITERATIONS = 8
_BESIDE = slot(FORMATION_DISTANCE_M)


class IdealRun(InProcessRun):
    """A run whose prediction moves, from timestep 4 on, are replaced by ideal ones."""

    def __init__(self, scenario: Scenario, listen: Callable[[str, Message], None], *, close: bool) -> None:
        self._poses: dict[str, Pose] = {}
        self._predicting: set[str] = set()
        self._changes: dict[str, Motion] = {}  # what was commanded in this timestep less what was predicted
        self._camera_errors: dict[str, list[tuple[float, float]]] = defaultdict(list)
        self._odometry = {names.ground_truth_odom(robot).of(): robot for robot in scenario.robots}
        world = scenario.world
        self._surface = world.make_surface()
        self._face = TargetFace(Camera(self._surface, world), world)
        self._alignment = scenario.fine_tuner.alignment
        self._places = dict(zip(scenario.robots[1:], scenario.slots, strict=True))
        super().__init__(scenario, listen=listen)
        self._predictors: dict[str, PredictorComponent] = {}
        for hosted in self._hosted:
            if close and isinstance(hosted.component, PredictorComponent):
                self._predictors[hosted.namespace] = hosted.component

    def _send(self, namespace: str, topic: names.Topic, message: Message) -> None:
        if (robot := self._odometry.get(names.absolute(namespace, topic.name))) is not None:
            self._poses[robot] = _pose(conversions.as_message(message, topic.type).pose.pose)
        elif topic == names.ALIGNMENT and AlignmentState.parse(message.data) is AlignmentState.PREDICT:
            self._predicting.add(namespace)
        elif topic == names.MOVE and namespace in self._predicting:
            self._predicting.discard(namespace)
            predicted, motion = conversions.read_move(message), self._ideal(namespace)
            self._changes[namespace] = Motion(motion.x_m - predicted.x_m, motion.y_m - predicted.y_m)
            message = conversions.move(motion, message.header.frame_id, conversions.stamp_of(message))
        elif topic == names.COMMANDED and namespace in self._changes:
            message = _changed(message, self._changes.pop(namespace))
        elif topic == names.RESIDUAL and conversions.has_estimate(message):
            self._learn(namespace, conversions.read_displacement(message))
        super()._send(namespace, topic, message)

    def _wanted(self, namespace: str, topic: names.Topic) -> bool:
        return names.absolute(namespace, topic.name) in self._odometry or super()._wanted(namespace, topic)

    def _learn(self, namespace: str, residual: Motion) -> None:
        """Compare the camera's residual with the truth: the difference is mostly the same in each timestep."""
        robot = namespace.removeprefix("/")
        neighbour = self._poses[names.beacon_neighbour(robot)]
        dx_m, dy_m = self._face.offset(self._poses[robot], neighbour, self._alignment, self._places[robot])
        self._camera_errors[namespace].append((residual.x_m - dx_m, residual.y_m - dy_m))

    def _ideal(self, namespace: str) -> Motion:
        """Find the move after which the camera would see no offset, by fixed-point iteration on its own estimate."""
        robot = namespace.removeprefix("/")
        start, neighbour = self._poses[robot], self._poses[names.beacon_neighbour(robot)]
        error_x_m, error_y_m = np.mean(self._camera_errors[namespace] or [(0.0, 0.0)], axis=0).tolist()
        x_m = y_m = 0.0
        for _ in range(_ITERATIONS):
            along, across, _ = start.place((x_m, y_m, 0.0))
            there = pose_on_surface(self._surface, along, across, start.yaw_rad)
            dx_m, dy_m = self._face.offset(there, neighbour, self._alignment, self._places[robot])
            x_m, y_m = x_m + dx_m + error_x_m, y_m + dy_m + error_y_m
        predictor = self._predictors.get(namespace)
        bias_u, bias_v = predictor.actuation_bias() if predictor is not None else (0.0, 0.0)
        return Motion(x_m - bias_v, y_m + bias_u)


class TargetFace:
    """What a noise-free camera would say of the neighbour's Target face."""

    def __init__(self, camera: Camera, world: WorldParameters) -> None:
        half, top = world.marker.edge_m / 2.0, world.marker.top_m
        self._camera = camera
        self._centre_px = world.camera.centre_x_px
        self._corners = np.array([(x, -half, z) for x in (-half, half) for z in (top - 2.0 * half, top)])

    def offset(
        self, robot: Pose, neighbour: Pose, alignment: AlignmentParameters, place: Motion = _BESIDE
    ) -> tuple[float, float]:
        """Way to the place, given in the neighbour's frame, as the fine-tuner reckons it: (x, y) in metres."""
        alignment = alignment.at_place(place)
        corners = self._corners @ neighbour.matrix().T + np.asarray(neighbour.position)
        pixels = self._camera.project(robot, corners)
        width, height = np.ptp(pixels, axis=0)
        column = float(pixels[:, 0].min() + width / 2.0)
        side = max(float(width), float(height))
        return (
            (column - self._centre_px) / alignment.slope_px_per_m + place.v_m,
            alignment.side_px_m / side - alignment.distance_m,
        )


def _changed(commanded: Message, change: Motion) -> Message:
    """Report to the predictor the move that was commanded in place of its own: it learns the robot's bias from it."""
    if not conversions.has_estimate(commanded):
        return commanded
    motion = conversions.read_displacement(commanded)
    changed = Motion(motion.x_m + change.x_m, motion.y_m + change.y_m, motion.yaw_rad)
    stamp_ns = conversions.stamp_of(commanded)
    return conversions.displacement(
        changed, commanded.header.frame_id, stamp_ns, conversions.read_covariance(commanded)
    )


def _pose(message: Message) -> Pose:
    p, q = message.position, message.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
