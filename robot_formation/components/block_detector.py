"""Block detector: the Pixy2's colour connected components on the camera's pictures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.parameters import parameter
from robot_formation.paths import config_dir
from robot_formation.vision.detector import BlockDetector
from robot_formation.vision.parameters import DetectorParameters
from robot_formation.vision.signatures import load_signatures
from robot_formation.vision.tracking import ClockError

WIDTH_PX, HEIGHT_PX = 316, 208


@dataclass(frozen=True)
class BlockDetectorNodeParameters(DetectorParameters):
    """The camera's own parameters and where its taught signatures are stored."""

    signatures_file: str = parameter(
        "", "YAML or JSON file of taught signatures; empty: config/signatures.yaml, taught under the world's light"
    )


class BlockDetectorComponent(Component):
    """Answers each picture with its blocks, in the picture's frame and with its stamp."""

    def __init__(self, parameters: BlockDetectorNodeParameters, place: Place) -> None:
        super().__init__(place)
        path = Path(parameters.signatures_file) if parameters.signatures_file else config_dir() / "signatures.yaml"
        self._detector = BlockDetector(load_signatures(path), parameters)
        self._frames = 0
        self._dropped = 0
        self._scaled = False
        self._image_wanted = False

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [Input(names.camera_image(), self._on_image)]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [names.BLOCKS, names.BLOCKS_IMAGE]

    def listened_to(self, topic: names.Topic, listeners: int) -> None:
        """See `Component`: the annotated picture is drawn only while somebody listens."""
        if topic == names.BLOCKS_IMAGE:
            self._image_wanted = listeners > 0

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {"frames": str(self._frames), "dropped": str(self._dropped)}

    def _on_image(self, message: Any) -> None:
        try:
            pixels = conversions.read_image(message)
        except conversions.MessageError as error:
            self._dropped += 1
            self.warn(str(error))
            return
        if pixels.shape[:2] != (HEIGHT_PX, WIDTH_PX):
            if not self._scaled:
                self._scaled = True
                self.warn(f"pictures of {pixels.shape[1]} x {pixels.shape[0]} are scaled to {WIDTH_PX} x {HEIGHT_PX}")
            pixels = np.asarray(cv2.resize(pixels, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        stamp_ns = conversions.stamp_of(message)
        try:
            blocks = self._detector.process(pixels, stamp_ns // 1000)
        except ClockError as error:
            self._dropped += 1
            self.warn(str(error))
            return
        self._frames += 1
        self.stamp_ns = stamp_ns
        frame = message.header.frame_id
        self._send(names.BLOCKS, conversions.blocks(blocks, frame, self.stamp_ns))
        if self._image_wanted:
            picture = pixels.copy()
            for block in blocks:
                corner = (block.x - block.width // 2, block.y - block.height // 2)
                opposite = (block.x + block.width // 2, block.y + block.height // 2)
                cv2.rectangle(picture, corner, opposite, (255, 255, 255), 1)
                label = f"{block.signature}:{block.index}"
                cv2.putText(
                    picture, label, (corner[0], corner[1] - 3), cv2.FONT_HERSHEY_SIMPLEX, 0.35, (255, 255, 255), 1
                )
            self._send(names.BLOCKS_IMAGE, conversions.image(picture, frame, self.stamp_ns))
