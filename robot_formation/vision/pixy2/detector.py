"""The block detector: a Pixy2's "color connected components" from a picture to reported blocks."""

from __future__ import annotations

from collections.abc import Iterable

from numpy.typing import ArrayLike

from robot_formation.vision.pixy2.blobs import connect
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_tracking import ALL_BLOCKS, ALL_SIGNATURES, Tracker
from robot_formation.vision.pixy2.boxes import CODE_AREA, Box, filtered, merged, without_nested
from robot_formation.vision.pixy2.codes import with_codes
from robot_formation.vision.pixy2.color_table import ColorTable, is_code
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import checked
from robot_formation.vision.pixy2.scanner import Scanner
from robot_formation.vision.pixy2.segments import Segments
from robot_formation.vision.pixy2.signatures import Signature, sorted_unique

_MIXED = 3


class BlockDetector:
    """Finds blocks of taught colours in pictures and tracks them, as the camera does.

    The colour table is built when signatures or parameters change, not per frame.

    Args:
        signatures: the taught colours, in any order.
        parameters: what a user tunes; the camera's defaults unless given.

    Raises:
        SignatureError: if a signature's number occurs twice.
    """

    def __init__(self, signatures: Iterable[Signature], parameters: DetectorParameters | None = None) -> None:
        self._parameters = parameters or DetectorParameters()
        self._tracker = Tracker(self._parameters.block_filtering, self._parameters.max_tracking_velocity)
        self.configure(signatures, self._parameters)

    @property
    def parameters(self) -> DetectorParameters:
        """The parameters in force."""
        return self._parameters

    @property
    def signatures(self) -> list[Signature]:
        """The signatures in force, by number."""
        return list(self._signatures)

    def configure(self, signatures: Iterable[Signature], parameters: DetectorParameters) -> None:
        """Change signatures and parameters; tracked blocks are kept.

        Raises:
            SignatureError: if a signature's number occurs twice.
        """
        self._signatures = sorted_unique(signatures)
        self._parameters = parameters
        self._scanner = Scanner(ColorTable.of(self._signatures, parameters))
        self._codes = {s.sig for s in self._signatures if is_code(s, parameters.color_code_mode)}
        self._tracker.configure(parameters.block_filtering, parameters.max_tracking_velocity)

    def reset(self) -> None:
        """Forget all tracked blocks; the next frame starts the clock and the indices anew."""
        self._tracker.reset()

    def detect(self, picture: ArrayLike) -> list[Box]:
        """Boxes in a single picture, without tracking.

        Args:
            picture: RGB, shape (208, 316, 3), uint8.

        Returns:
            Boxes by signature, then area of their largest component; colour codes last.

        Raises:
            PictureError: if the picture has another shape or type.
        """
        return self._boxes(self._scanner.scan(checked(picture)))

    def process(self, picture: ArrayLike, time_us: int) -> list[Block]:
        """Process the next frame and return the tracked blocks.

        Args:
            picture: RGB, shape (208, 316, 3), uint8.
            time_us: the frame's time, microseconds; the first frame's time is the clock's origin.

        Returns:
            At most 18 blocks, largest width * height first: the camera's answer to a request for all blocks.

        Raises:
            PictureError: if the picture has another shape or type.
            ClockError: if the time is not later than the previous frame's.
        """
        self._tracker.step(self.detect(picture), time_us)
        return self.get_blocks()

    def get_blocks(self, sigmap: int = ALL_SIGNATURES, max_blocks: int = ALL_BLOCKS) -> list[Block]:
        """Blocks of the last frame as the camera's getBlocks request answers.

        Args:
            sigmap: bit sig-1 for each signature wanted, 0x80 for colour codes.
            max_blocks: how many blocks are wanted.
        """
        return self._tracker.answer(sigmap, max_blocks)

    def _boxes(self, segments: Segments) -> list[Box]:
        """Blobs per signature, filtered, merged, without nested ones; then colour codes."""
        parameters = self._parameters
        boxes: list[Box] = []
        room = parameters.max_blocks
        for number, blobs in connect(segments).items():
            code = number in self._codes
            min_area = CODE_AREA if code else parameters.min_block_area
            mine = filtered(blobs[: parameters.max_blocks_per_signature], min_area, room)
            room -= len(mine)
            boxes += mine if code else merged(mine, parameters.max_merge_dist)
        boxes = without_nested(boxes)
        if not self._codes:
            return boxes
        plain = [box for box in boxes if box.signature not in self._codes]
        parts = [box for box in boxes if box.signature in self._codes]
        return with_codes(plain, parts, keep_single=parameters.color_code_mode == _MIXED)
