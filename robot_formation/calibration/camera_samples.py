"""What a follower's camera reports at places around its neighbour, and the four areas that follow from it.

Paper, "Visual fine-tuning process calibrations": blocks at every 5 cm and nine relative angles, overlaid, give the
Unattainable, Front, Target and Rear areas.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block


@dataclass(frozen=True)
class CameraSample:
    """One look from one place.

    Attributes:
        u_m: place of the follower to the right of its neighbour, in the neighbour's frame.
        v_m: place of the follower ahead of its neighbour.
        clockwise_deg: heading of the follower against its neighbour's, positive clockwise (paper).
        attainable: whether both robots fit; nothing is looked at where they don't.
        frames: frames that the look took.
        blocks: what the camera reported in the last one.
    """

    u_m: float
    v_m: float
    clockwise_deg: float
    attainable: bool
    frames: int = 0
    blocks: tuple[Block, ...] = ()


class Kind(Enum):
    """What a look shows of the marker: at least the Front block, the Target block alone, or at least the Rear block."""

    FRONT = "front"
    TARGET = "target"
    REAR = "rear"


@dataclass(frozen=True)
class Overlay:
    """A position with all relative angles overlaid.

    Attributes:
        u_m: as in `CameraSample`.
        v_m: as in `CameraSample`.
        angles: relative angles that were tried.
        attainable: angles at which both robots fit.
        seen: angles at which the camera reports a block.
        kinds: what it shows at these angles.
    """

    u_m: float
    v_m: float
    angles: int
    attainable: int
    seen: int
    kinds: frozenset[Kind]

    @property
    def area(self) -> str:
        """Name of the area; two kinds joined by 'or' where the angle decides."""
        if self.attainable == 0:
            return "unattainable"
        return " or ".join(kind.value for kind in Kind if kind in self.kinds) or "nothing"


def kinds_of(sample: CameraSample) -> frozenset[Kind]:
    """Tell what a look shows; Front and Rear together, which flicker can make, count as both."""
    seen = {block.signature for block in sample.blocks}
    found = {kind for kind, signature in ((Kind.FRONT, Face.FRONT), (Kind.REAR, Face.REAR)) if signature in seen}
    return frozenset(found or ({Kind.TARGET} if Face.TARGET in seen else ()))


def overlay(samples: Iterable[CameraSample]) -> list[Overlay]:
    """Overlay all relative angles of each position; positions in the order of their first sample."""
    groups: dict[tuple[float, float], list[CameraSample]] = {}
    for sample in samples:
        groups.setdefault((sample.u_m, sample.v_m), []).append(sample)
    places = []
    for (u, v), group in groups.items():
        kinds = [kinds_of(sample) for sample in group]
        places.append(
            Overlay(
                u,
                v,
                angles=len(group),
                attainable=sum(sample.attainable for sample in group),
                seen=sum(map(bool, kinds)),
                kinds=frozenset().union(*kinds),
            )
        )
    return places
