"""A look at the marker as sub-pixel edges: blocks of several frames put together, the detector's own bias taken out."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from robot_formation.alignment.observation import MARGIN_PX, FaceBox, bounding_boxes
from robot_formation.parameters import ParameterError, parameter
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH

# All chosen.
_CUT = 6.0
"""Factor on the scatter of the rows of a face that the picture cuts off: the hidden part may reach higher."""
_SPLIT_PX = 12.0
"""Widest gap between the pieces of a face that flicker has split."""
_LATE_PX = 0.5
"""Further bias of the Target block's left edge beside a Front block: the detector begins a row's earlier segments up to
one cell of 2 px late."""
_BESIDE_FRONT = 1.6
"""Factor on that edge's scatter there."""
_OTHER_ROWS = 1.5
"""Factor on the scatter of rows that aren't the Target face's: their edges slant."""


@dataclass(frozen=True)
class EdgeParameters:
    """What the detector reports more than the true edge, and how that scatters; measured with `calibrate vision`."""

    target_left_px: float = parameter(2.0, "Bias of the Target block's left edge", unit="px", low=-20.0, high=20.0)
    target_right_px: float = parameter(
        0.1, "Bias of its right edge where no Front block follows", unit="px", low=-20.0, high=20.0
    )
    target_top_px: float = parameter(1.25, "Bias of its upper edge", unit="px", low=-20.0, high=20.0)
    target_bottom_px: float = parameter(-1.15, "Bias of its lower edge", unit="px", low=-20.0, high=20.0)
    front_left_px: float = parameter(2.3, "Bias of the Front block's left edge", unit="px", low=-20.0, high=20.0)
    front_widths_px: tuple[float, ...] = parameter(
        (10.0, 13.0, 18.0),
        "Reported widths of the Front block where the error of its right edge jumps, ascending: "
        "the detector goes along a row in strides",
        unit="px",
        low=0.0,
        high=316.0,
    )
    front_right_px: tuple[float, ...] = parameter(
        (-2.0, -0.2, -1.1, -0.3),
        "Bias of its right edge below the first of these widths, between them and above the last",
        unit="px",
        low=-20.0,
        high=20.0,
    )
    front_right_sigma_px: tuple[float, ...] = parameter(
        (1.7, 0.9, 1.4, 0.9), "Scatter of its right edge, likewise", unit="px", low=0.01, high=20.0
    )
    rear_widths_px: tuple[float, ...] = parameter(
        (13.0, 17.0, 21.0),
        "Reported widths of the Rear block where the error of its left edge jumps, ascending",
        unit="px",
        low=0.0,
        high=316.0,
    )
    rear_left_px: tuple[float, ...] = parameter(
        (3.5, 2.5, 3.4, 2.6),
        "Bias of its left edge below the first of these widths, between them and above the last",
        unit="px",
        low=-20.0,
        high=20.0,
    )
    rear_left_sigma_px: tuple[float, ...] = parameter(
        (0.9, 1.1, 0.9, 1.0), "Scatter of its left edge, likewise", unit="px", low=0.01, high=20.0
    )
    clear_height_px: float = parameter(
        44.0,
        "Height of the Target block from which on these values hold; smaller is too far away",
        unit="px",
        low=0.0,
        high=208.0,
    )
    clear_ratio: float = parameter(
        0.85, "Width by height of the Target block from which on they hold; narrower is too oblique", low=0.0, high=10.0
    )
    rough_front_right_px: float = parameter(
        -0.8, "Bias of the Front block's right edge in other views", unit="px", low=-20.0, high=20.0
    )
    rough_rear_left_px: float = parameter(
        3.7, "Bias of the Rear block's left edge in other views", unit="px", low=-20.0, high=20.0
    )
    rough_sigma_px: float = parameter(1.6, "Scatter of both in other views", unit="px", low=0.01, high=20.0)
    column_sigma_px: float = parameter(0.9, "Scatter of a face's nearer edges", unit="px", low=0.01, high=20.0)
    sliver_px: float = parameter(
        5.6,
        "Bias of the Target block's right edge beside a Front face too narrow to be reported",
        unit="px",
        low=-20.0,
        high=20.0,
    )
    sliver_from_px: float = parameter(4.0, "Width of that face at which it begins", unit="px", low=0.0, high=50.0)
    sliver_to_px: float = parameter(7.5, "Width of that face from which on it is full", unit="px", low=0.0, high=50.0)
    row_sigma_px: float = parameter(0.45, "Scatter of upper and lower edges", unit="px", low=0.01, high=20.0)
    front_shows_px: float = parameter(
        14.0, "Width from which on the Front face is always reported", unit="px", low=1.0, high=100.0
    )
    rear_shows_px: float = parameter(
        15.5, "Width from which on the Rear face is always reported", unit="px", low=1.0, high=100.0
    )
    hidden_sigma_px: float = parameter(1.5, "How sharp these bounds are", unit="px", low=0.01, high=20.0)

    def __post_init__(self) -> None:
        """Check that the widths ascend and part as many values as there are."""
        for face, side in (("front", "right"), ("rear", "left")):
            widths = getattr(self, f"{face}_widths_px")
            lengths = {len(getattr(self, f"{face}_{side}_{name}")) for name in ("px", "sigma_px")}
            if lengths != {len(widths) + 1} or list(widths) != sorted(widths):
                raise ParameterError(
                    f"fine_tuner: '{face}_widths_px' must ascend, and '{face}_{side}_px' and '{face}_{side}_sigma_px' "
                    "have one value more than it"
                )

    @property
    def height_bias_px(self) -> float:
        """What the detector reports more than a block's true height, px."""
        return self.target_bottom_px - self.target_top_px

    def clear(self, target: FaceBox | None) -> bool:
        """Whether the marker is near and frontal enough for the finer values of its outer edges."""
        if target is None or target.height < self.clear_height_px:
            return False
        return target.width >= self.clear_ratio * target.height

    def front_band(self, width_px: float) -> int:
        """Tell which values hold for a Front block of this reported width."""
        return bisect_right(self.front_widths_px, width_px)

    def rear_band(self, width_px: float) -> int:
        """Tell which values hold for a Rear block of this reported width."""
        return bisect_right(self.rear_widths_px, width_px)

    def front_right(self, front: FaceBox, target: FaceBox | None) -> tuple[float, float]:
        """Tell bias and scatter of the Front block's right edge, px."""
        if not self.clear(target):
            return self.rough_front_right_px, self.rough_sigma_px
        band = self.front_band(front.width)
        return self.front_right_px[band], self.front_right_sigma_px[band]

    def rear_left(self, rear: FaceBox, target: FaceBox | None) -> tuple[float, float]:
        """Tell bias and scatter of the Rear block's left edge, px."""
        if not self.clear(target):
            return self.rough_rear_left_px, self.rough_sigma_px
        band = self.rear_band(rear.width)
        return self.rear_left_px[band], self.rear_left_sigma_px[band]


@dataclass(frozen=True)
class Edge:
    """One measured edge: face, side, position [px] and its standard deviation [px].

    The side "width" means a face that isn't reported: it can't be wider than this.
    """

    face: Face
    side: str
    position_px: float
    sigma_px: float


@dataclass(frozen=True)
class View:
    """The edges of a look, and which faces were reported."""

    edges: tuple[Edge, ...]
    faces: frozenset[Face]


def one_marker(blocks: Iterable[Block], cost: Callable[[Block], float]) -> list[Block]:
    """Keep one object of each signature: the block of least cost, and what a split by flicker may have cut off it."""
    kept: list[Block] = []
    chosen: dict[int, Block] = {}
    for block in sorted(blocks, key=cost):
        first = chosen.setdefault(block.signature, block)
        gap_x = abs(block.x - first.x) - 0.5 * (block.width + first.width)
        gap_y = abs(block.y - first.y) - 0.5 * (block.height + first.height)
        if max(gap_x, gap_y) <= _SPLIT_PX:
            kept.append(block)
    return kept


def mean_boxes(frames: Sequence[Sequence[Block]]) -> dict[Face, FaceBox]:
    """Average each face's box over the frames that report the faces which the last frame reports."""
    last = set(bounding_boxes(frames[-1])) if frames else set()
    groups = [boxes for boxes in map(bounding_boxes, frames) if set(boxes) == last]
    return {face: _mean([boxes[face] for boxes in groups]) for face in sorted(last)}


def _mean(boxes: Sequence[FaceBox]) -> FaceBox:
    count = len(boxes)
    return FaceBox(
        sum(box.left for box in boxes) / count,
        sum(box.right for box in boxes) / count,
        sum(box.top for box in boxes) / count,
        sum(box.bottom for box in boxes) / count,
    )


def view(boxes: dict[Face, FaceBox], p: EdgeParameters) -> View:
    """Take the edges that can be trusted out of a look's boxes.

    Where two faces meet, the one on the right tells the common edge: the detector's rows are exact there only. The
    rows are those of the widest face: a sliver is often broken up in height.
    """
    edges: list[Edge] = []
    near = p.column_sigma_px
    target, front, rear = boxes.get(Face.TARGET), boxes.get(Face.FRONT), boxes.get(Face.REAR)
    if target is not None:
        # The detector begins a row's earlier segments one cell late.
        late, sigma = (_LATE_PX, _BESIDE_FRONT * near) if front is not None else (0.0, near)
        edges.append(Edge(Face.TARGET, "left", target.left - p.target_left_px - late, sigma))
        if front is None:
            edges.append(Edge(Face.TARGET, "right", target.right - p.target_right_px, near))
    if front is not None:
        edges.append(Edge(Face.FRONT, "left", front.left - p.front_left_px, near))
        bias, sigma = p.front_right(front, target)
        edges.append(Edge(Face.FRONT, "right", front.right - bias, sigma))
    if rear is not None:
        # Its right edge isn't sharp: it may take in a sliver of the Target face.
        bias, sigma = p.rear_left(rear, target)
        edges.append(Edge(Face.REAR, "left", rear.left - bias, sigma))
    if boxes:
        widest = max(boxes, key=lambda face: boxes[face].width)
        edges += _rows(widest, boxes[widest], p, 1.0 if widest == Face.TARGET else _OTHER_ROWS)
    return View(tuple(edge for edge in edges if _inside(edge)), frozenset(boxes))


def hidden(view: View, p: EdgeParameters) -> Iterable[Edge]:
    """List bounds on the widths of faces that the look does not report."""
    for face, width in ((Face.FRONT, p.front_shows_px), (Face.REAR, p.rear_shows_px), (Face.TARGET, p.front_shows_px)):
        if face not in view.faces:
            yield Edge(face, "width", width, p.hidden_sigma_px)


def sliver(edge: Edge, front_px: float, p: EdgeParameters) -> Edge:
    """Correct the Target block's right edge for a Front face of this true width that is not reported."""
    share = min(1.0, max(0.0, (front_px - p.sliver_from_px) / max(p.sliver_to_px - p.sliver_from_px, 1e-6)))
    # Halfway, a little noise decides.
    sigma = edge.sigma_px + p.sliver_px * 2.0 * share * (1.0 - share)
    return replace(edge, position_px=edge.position_px - p.sliver_px * share, sigma_px=sigma)


def _rows(face: Face, box: FaceBox, p: EdgeParameters, scale: float) -> Iterable[Edge]:
    cut = box.left < MARGIN_PX or box.right > WIDTH - 1.0 - MARGIN_PX
    sigma = scale * p.row_sigma_px * (_CUT if cut else 1.0)
    return (
        Edge(face, "top", box.top - p.target_top_px, sigma),
        Edge(face, "bottom", box.bottom - p.target_bottom_px, sigma),
    )


def _inside(edge: Edge) -> bool:
    size = WIDTH if edge.side in ("left", "right") else HEIGHT
    return MARGIN_PX < edge.position_px < size - MARGIN_PX
