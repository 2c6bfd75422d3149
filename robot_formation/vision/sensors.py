"""What turns pictures into blocks, found by name: of the package, or a class from outside."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, cast

from numpy.typing import ArrayLike

from robot_formation import plugins
from robot_formation.vision.marker import MarkerKind
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_tracking import ALL_BLOCKS, ALL_SIGNATURES, Tracker
from robot_formation.vision.pixy2.boxes import Box
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import checked

KIND = "sensor"
SENSORS = {
    MarkerKind.COLOURS.value: "blocks of taught colours, as a Pixy2 finds them",
    MarkerKind.TAGS.value: "the ArUco tags of a marker of that kind",
}
"""What each of the package's own is, in a line."""


class BlockSensor(Protocol):
    """What turns pictures into tracked blocks: signatures 1, 2 and 3 are the Target, Front and Rear faces."""

    def process(self, picture: ArrayLike, time_us: int) -> list[Block]:
        """Process the next frame, RGB (208, 316, 3) uint8 at a time in microseconds, and report the tracked blocks.

        Raises:
            PictureError: if the picture has another shape or type.
            ClockError: if the time is not later than the previous frame's.
        """

    def reset(self) -> None:
        """Forget all tracked blocks."""


class OutsideSensor:
    """A sensor made of a class from outside, which needs one method.

    `detect(picture)` is shown an RGB picture, uint8 (208, 316, 3), and returns its blocks, each as five numbers:
    signature (1, 2, 3: Target, Front and Rear face), column and row of the centre, width and height, in pixels. They
    are tracked as the Pixy2 does. A class with `process(picture, time_us)` and `reset()` is taken as it is
    (`BlockSensor`).
    """

    def __init__(self, name: str, made: Any, tracking: DetectorParameters) -> None:
        """Take an object of such a class; `name` is for messages, `tracking` for its filtering of blocks."""
        self._name = name
        self._made = made
        self._tracker = Tracker(tracking.block_filtering, tracking.max_tracking_velocity)

    def process(self, picture: ArrayLike, time_us: int) -> list[Block]:
        """See `BlockSensor`.

        Raises:
            PluginError: if the class fails, or returns no blocks.
        """
        with plugins.guarded(KIND, self._name, "detect"):
            boxes = _boxes(self._made.detect(checked(picture)))
        self._tracker.step(boxes, time_us)
        return self._tracker.answer(ALL_SIGNATURES, ALL_BLOCKS)

    def reset(self) -> None:
        """See `BlockSensor`."""
        self._tracker.reset()


def is_outside_sensor(name: object) -> bool:
    """Whether a name may be that of a sensor from outside the package; its class is not imported for it."""
    return isinstance(name, str) and name not in SENSORS and plugins.may_be(name, KIND)


def find_sensor(name: str) -> None:
    """Check that a sensor's class is there and can be made.

    Raises:
        PluginError: if not.
    """
    if name not in SENSORS:
        _make(name, plugins.load(KIND, name))


def outside_sensor(name: str, tracking: DetectorParameters) -> BlockSensor:
    """Make a sensor of a class from outside the package.

    Raises:
        PluginError: if it can't be imported or made.
    """
    return made_sensor(name, plugins.load(KIND, name), tracking)


def made_sensor(name: str, kind: type, tracking: DetectorParameters) -> BlockSensor:
    """Make a sensor of a class; `name` is for messages.

    Raises:
        PluginError: if it can't be made, or lacks a method.
    """
    made = _make(name, kind)
    return cast(BlockSensor, made) if callable(getattr(made, "process", None)) else OutsideSensor(name, made, tracking)


def _make(name: str, kind: type) -> Any:
    if not any(callable(getattr(kind, method, None)) for method in ("detect", "process")):
        raise plugins.PluginError(f"{KIND} '{name}': it has no method 'detect'; see docs/how-to/extend.md")
    with plugins.guarded(KIND, name, "making one without arguments"):
        return kind()


def _boxes(found: Iterable[Iterable[float]]) -> list[Box]:
    boxes = []
    for block in found:
        signature, x, y, width, height = (round(float(number)) for number in block)
        left, top = x - width // 2, y - height // 2
        boxes.append(Box(signature, left, left + width, top, top + height))
    return boxes
