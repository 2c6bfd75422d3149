"""The bag of what a camera's calibration has seen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from robot_formation import conversions, names
from robot_formation.bag.message_recorder import Recorder
from robot_formation.calibration.alignment_trial import FOLLOWER
from robot_formation.calibration.camera_grid import Conditions, stand
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.names import Message
from robot_formation.world.description import robot_description
from robot_formation.world.pose import Pose

_NS = 10**9


def write_bag(path: Path, samples: Iterable[CameraSample], conditions: Conditions, metadata: Mapping[str, str]) -> Path:
    """Write what was seen, one place after the other: the follower's blocks, both true poses, the camera's calibration.

    Each attainable place has its own time, in which the longest look fits; poses are stamped at its beginning, blocks
    at its last frame.

    Raises:
        BagError: if the path is taken or can't be written.
    """
    world, look = conditions.world, conditions.look
    rate = world.camera.min_frames_per_second
    longest = look.frames + look.max_extensions * look.extra_frames
    period_ns = (longest // rate + 1) * _NS
    recorder = Recorder(path, metadata)
    try:
        _write_descriptions(recorder, conditions)
        for number, sample in enumerate(s for s in samples if s.attainable):
            begin_ns = number * period_ns
            poses = stand(world, sample.u_m, sample.v_m, sample.clockwise_deg)
            for robot, pose in zip((names.LEADER, FOLLOWER), poses, strict=True):
                _record(recorder, "", names.ground_truth_odom(robot), _odometry(pose, robot, begin_ns))
            end_ns = begin_ns + sample.frames * _NS // rate
            blocks = conversions.blocks(sample.blocks, f"{FOLLOWER}/{names.OPTICAL_FRAME}", end_ns)
            _record(recorder, FOLLOWER, names.BLOCKS, blocks)
    finally:
        recorder.close()
    return path


def _write_descriptions(recorder: Recorder, conditions: Conditions) -> None:
    world = conditions.world
    p = world.camera
    centre = (p.centre_x_px, p.centre_y_px)
    frame = f"{FOLLOWER}/{names.OPTICAL_FRAME}"
    info = conversions.camera_info(p.width_px, p.height_px, p.focal_length_px, centre, frame, 0)
    _record(recorder, "", names.camera_info(FOLLOWER), info)
    for robot in (names.LEADER, FOLLOWER):
        text = robot_description(robot, world, camera=robot == FOLLOWER)
        _record(recorder, "", names.robot_description(robot), conversions.string(text))


def _odometry(pose: Pose, robot: str, stamp_ns: int) -> object:
    rest = (0.0, 0.0, 0.0)
    return conversions.body_odometry(
        pose.position,
        pose.orientation,
        rest,
        rest,
        frame=names.WORLD_FRAME,
        child=f"{robot}/{names.BASE_FRAME}",
        stamp_ns=stamp_ns,
    )


def _record(recorder: Recorder, robot: str, topic: names.Topic, message: Message) -> None:
    recorder.record_as(topic.of(robot), topic, conversions.to_cdr(message))
