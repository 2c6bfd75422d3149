"""What a follower's camera shows, with the blocks that its detector has found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robot_formation.viewing.replayed_camera import ReplayedCamera
from robot_formation.vision.marker import Face

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle
    from matplotlib.text import Text

_MOST_BLOCKS = 8
"""Blocks that are drawn; a marker has three faces."""
_LABEL_PX, _GAP_PX = 15.0, 4.0
"""Height of a label, and its distance from its block, in the camera's pixels."""


class CameraPanel:
    """The panel; `artists` are what changes with time, in the order in which they are drawn."""

    def __init__(self, axes: Axes, camera: ReplayedCamera, stamp_ns: int) -> None:
        from matplotlib.patheffects import withStroke

        self._axes, self._camera = axes, camera
        picture = camera.view(stamp_ns).picture
        axes.set(xticks=[], yticks=[])
        axes.spines[["top", "right"]].set_visible(True)
        self._image = axes.imshow(picture, animated=True, interpolation="antialiased")
        halo = [withStroke(linewidth=3.6, foreground="black")]
        self._boxes = [self._box(halo) for _ in range(_MOST_BLOCKS)]
        self._labels = [self._label() for _ in range(_MOST_BLOCKS)]
        self.artists: list[Artist] = [self._image, *self._boxes, *self._labels]

    def _box(self, halo: list[Any]) -> Rectangle:
        from matplotlib.patches import Rectangle

        style: dict[str, Any] = {"fill": False, "edgecolor": "white", "linewidth": 1.6, "path_effects": halo}
        box = Rectangle((0.0, 0.0), 1.0, 1.0, animated=True, **style)
        self._axes.add_patch(box)
        return box

    def _label(self) -> Text:
        backed = {"facecolor": "black", "edgecolor": "none", "pad": 1.2}
        return self._axes.text(
            0.0, 0.0, "", color="white", fontsize=8, ha="left", va="bottom", bbox=backed, animated=True, clip_on=True
        )

    def update(self, stamp_ns: int) -> None:
        """Show a time."""
        picture, blocks = self._camera.view(stamp_ns)
        self._image.set_data(picture)
        for number, (box, label) in enumerate(zip(self._boxes, self._labels, strict=True)):
            shown = number < len(blocks)
            box.set_visible(shown)
            label.set_visible(shown)
            if shown:
                block = blocks[number]
                # Integer coordinates are pixel centres.
                left, top = block.x - block.width // 2 - 0.5, block.y - block.height // 2 - 0.5
                box.set_bounds(left, top, block.width, block.height)
                # The faces touch each other, so the labels of Front and Rear go below theirs.
                above = block.signature == Face.TARGET and top > _LABEL_PX
                label.set_position((left, top - _GAP_PX if above else top + block.height + _GAP_PX))
                label.set_verticalalignment("bottom" if above else "top")
                label.set_text(f"{_face(block.signature)} {block.width} x {block.height} px")


def _face(signature: int) -> str:
    """Return the name of the marker's face with this signature."""
    return Face(signature).name.capitalize() if signature in Face._value2member_map_ else f"signature {signature:o}"
