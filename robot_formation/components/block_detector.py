"""Block detector: the Pixy2's colour connected components, or tags, on the camera's pictures."""

from __future__ import annotations

import itertools
import statistics
from collections import deque
from collections.abc import Mapping
from typing import ClassVar

import cv2

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.components.node_parameters import BlockDetectorNodeParameters
from robot_formation.names import Message
from robot_formation.vision.aruco_detector import TagDetector
from robot_formation.vision.marker import MarkerKind
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_tracking import ClockError
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH, Picture
from robot_formation.vision.pixy2.scaling import scaled
from robot_formation.vision.sensors import BlockSensor, is_outside_sensor, outside_sensor

_RATE_FRAMES = 31
_WHITE = (255, 255, 255)


class BlockDetectorComponent(Component):
    """Answers each picture with its blocks, in the picture's frame and with its stamp."""

    fixed: ClassVar[Mapping[str, str]] = {}

    def __init__(self, parameters: BlockDetectorNodeParameters, place: Place) -> None:
        super().__init__(place)
        self._parameters = parameters
        self._detector = _detector(parameters)
        self._frames = 0
        self._dropped = 0
        self._scaled = False
        self._image_wanted = False
        self._stamps: deque[int] = deque(maxlen=_RATE_FRAMES)
        self._timed = 0
        self._total_s = 0.0
        self._worst_s = 0.0

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [Input(names.camera_image(), self._on_image)]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [names.BLOCKS, names.BLOCKS_IMAGE]

    def set_parameters(self, parameters: BlockDetectorNodeParameters) -> None:
        """See `Component`: tracked blocks are kept, unless the sensor changes; a changed file of signatures is read.

        Raises:
            FormationError: if that file, or the other sensor, can't be used; nothing is changed then.
        """
        old, detector = self._parameters, self._detector
        if parameters.sensor != old.sensor:
            self._detector = _detector(parameters)
        elif isinstance(detector, TagDetector):
            detector.configure(parameters.tags, parameters)
        elif isinstance(detector, BlockDetector):
            changed = parameters.signatures_file != old.signatures_file
            detector.configure(parameters.load() if changed else detector.signatures, parameters)
        self._parameters = parameters

    def listened_to(self, topic: names.Topic, listeners: int) -> None:
        """See `Component`: the annotated picture is drawn only while somebody listens."""
        if topic == names.BLOCKS_IMAGE:
            self._image_wanted = listeners > 0

    def details(self) -> dict[str, str]:
        """See `Component`."""
        periods = [later - earlier for earlier, later in itertools.pairwise(self._stamps)]
        # A sensor that was changed meanwhile takes a stamp once more: the period is 0 then.
        period_ns = statistics.median(periods) if periods else 0
        return {
            "frames": str(self._frames),
            "dropped": str(self._dropped),
            "frame_rate_hz": f"{1e9 / period_ns:.1f}" if period_ns > 0 else "",
            "processing_mean_ms": f"{1e3 * self._total_s / self._timed:.3f}" if self._timed else "",
            "processing_worst_ms": f"{1e3 * self._worst_s:.3f}" if self._timed else "",
        }

    def _on_image(self, message: Message) -> None:
        clock = self.wall_clock
        began = clock() if clock else 0.0
        try:
            pixels = self._picture(message)
            stamp_ns = conversions.stamp_of(message)
            blocks = self._detector.process(pixels, stamp_ns // 1000)
        except (conversions.MessageError, ClockError) as error:
            self._dropped += 1
            self.warn(str(error))
            return
        self._frames += 1
        self._stamps.append(stamp_ns)
        self.stamp_ns = stamp_ns
        frame = message.header.frame_id
        self._send(names.BLOCKS, conversions.blocks(blocks, frame, stamp_ns))
        if self._image_wanted:
            self._send(names.BLOCKS_IMAGE, conversions.image(_annotated(pixels, blocks), frame, stamp_ns))
        if clock:
            took_s = clock() - began
            self._timed += 1
            self._total_s += took_s
            self._worst_s = max(self._worst_s, took_s)

    def _picture(self, message: Message) -> Picture:
        pixels: Picture = conversions.read_image(message)
        height, width = pixels.shape[:2]
        if (width, height) != (WIDTH, HEIGHT) and not self._scaled:
            self._scaled = True
            self.warn(f"pictures of {width} x {height} are scaled to {WIDTH} x {HEIGHT}")
        return scaled(pixels)


def _detector(parameters: BlockDetectorNodeParameters) -> BlockSensor:
    if is_outside_sensor(parameters.sensor):
        return outside_sensor(parameters.sensor, parameters)
    if parameters.sensor == MarkerKind.TAGS:
        return TagDetector(parameters.tags, parameters)
    return BlockDetector(parameters.load(), parameters)


def _annotated(picture: Picture, blocks: list[Block]) -> Picture:
    """A copy of the picture with the blocks' boxes, each with its signature and index."""
    drawn: Picture = picture.copy()
    for block in blocks:
        corner = (block.x - block.width // 2, block.y - block.height // 2)
        opposite = (block.x + block.width // 2, block.y + block.height // 2)
        cv2.rectangle(drawn, corner, opposite, _WHITE, 1)
        label = f"{block.signature}:{block.index}"
        cv2.putText(drawn, label, (corner[0], corner[1] - 3), cv2.FONT_HERSHEY_SIMPLEX, 0.35, _WHITE, 1)
    return drawn
