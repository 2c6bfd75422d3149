"""Colour signatures: what the camera stores of a taught colour, teaching, and files (Pixy2 behaviour)."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import ArrayLike

from robot_formation.errors import FormationError, shown
from robot_formation.json_values import Json
from robot_formation.system.yaml_files import read_yaml
from robot_formation.vision.pixy2.parameters import SIGNATURES
from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH, checked
from robot_formation.vision.pixy2.teaching import BLOCK, IntArray, Point, TeachFrame, bounds, grow, packed

_FILE_NAMES = {
    "sig": "sig",
    "u_min": "uMin",
    "u_max": "uMax",
    "u_mean": "uMean",
    "v_min": "vMin",
    "v_max": "vMax",
    "v_mean": "vMean",
    "rgb": "rgb",
    "type": "type",
}
_OPTIONAL = {"rgb", "type"}
_BOUND = 2**31


class SignatureError(FormationError):
    """A signature, a region to teach or a file of signatures can't be used; the text says why and what to do."""


@dataclass(frozen=True)
class Signature:
    """A taught colour: bounds of the chroma u = (r-g)/(r+g+b) and v = (b-g)/(r+g+b) in 1/32768.

    Attributes:
        sig: number, 1..7.
        u_min: lower bound of u (about the 20th percentile of the samples).
        u_max: upper bound of u (about the 80th percentile).
        u_mean: middle of the bounds of u.
        v_min: lower bound of v.
        v_max: upper bound of v.
        v_mean: middle of the bounds of v.
        rgb: mean colour, 0xRRGGBB.
        type: 0 normal, 1 part of colour codes.
    """

    sig: int
    u_min: int
    u_max: int
    u_mean: int
    v_min: int
    v_max: int
    v_mean: int
    rgb: int = 0
    type: int = 0

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            SignatureError: if a value is outside what the camera can store.
        """
        if not 1 <= self.sig <= SIGNATURES:
            raise SignatureError(f"signature {shown(self.sig)} does not exist; use a number from 1 to {SIGNATURES}")
        if self.type not in (0, 1):
            raise SignatureError(f"signature {self.sig} has type {shown(self.type)}; use 0 (normal) or 1 (colour code)")
        if not 0 <= self.rgb <= 0xFFFFFF:
            raise SignatureError(f"signature {self.sig} has rgb {shown(self.rgb)}; use a number from 0 to {0xFFFFFF}")
        chroma = (self.u_min, self.u_max, self.u_mean, self.v_min, self.v_max, self.v_mean)
        if not all(-_BOUND <= value < _BOUND for value in chroma):
            raise SignatureError(f"signature {self.sig} has a bound of more than 32 bits; teach it again")

    def to_mapping(self) -> dict[str, int]:
        """Values by the names used in files: sig, uMin, uMax, uMean, vMin, vMax, vMean, rgb, type."""
        return {stored: getattr(self, name) for name, stored in _FILE_NAMES.items()}

    @classmethod
    def from_mapping(cls, values: Json, *, where: str) -> Signature:
        """Build a signature from the names used in files; rgb and type may be missing.

        Raises:
            SignatureError: on a missing or unknown name or a value that is not an integer.
        """
        if not isinstance(values, Mapping):
            raise SignatureError(
                f"{where}: a signature must be a mapping with sig, uMin, uMax, ..., not {shown(values)}"
            )
        for stored, value in values.items():
            if stored not in _FILE_NAMES.values():
                raise SignatureError(
                    f"{where}: a signature has no {shown(stored)}; there are {', '.join(_FILE_NAMES.values())}"
                )
            if isinstance(value, bool) or not isinstance(value, int):
                raise SignatureError(f"{where}: '{stored}' of a signature must be an integer, not {shown(value)}")
        missing = [s for n, s in _FILE_NAMES.items() if s not in values and n not in _OPTIONAL]
        if missing:
            raise SignatureError(f"{where}: a signature lacks {', '.join(missing)}; teach it again")
        try:
            return cls(**{name: values[stored] for name, stored in _FILE_NAMES.items() if stored in values})
        except SignatureError as error:
            raise SignatureError(f"{where}: {error}") from None


def teach_region(picture: ArrayLike, region: Sequence[int], sig: int) -> Signature:
    """Teach a signature from a rectangle, as "Set signature" does in PixyMon.

    Args:
        picture: RGB, shape (208, 316, 3), uint8.
        region: x, y, width, height in pixels, inside the picture.
        sig: the signature's number, 1..7.

    Raises:
        PictureError: if the picture has another shape or type.
        SignatureError: if the region is not inside the picture or too dark.
    """
    frame = TeachFrame.of(checked(picture))
    x, y, width, height = region
    if width < 1 or height < 1 or x < 0 or y < 0 or x + width > WIDTH or y + height > HEIGHT:
        raise SignatureError(
            f"the region {x},{y},{width},{height} (x, y, width, height) is not inside the {WIDTH} x {HEIGHT} picture"
        )
    return _signature(frame, [(x, y, width, height)], sig)


def teach_point(picture: ArrayLike, point: Point, threshold: int, sig: int) -> tuple[Signature, list[Point]]:
    """Teach a signature by growing from a point, as the camera's button does from the centre (158, 104).

    Args:
        picture: RGB, shape (208, 316, 3), uint8.
        point: x, y in pixels, inside the picture.
        threshold: "Signature teach threshold", chroma distance in 1/32768.
        sig: the signature's number, 1..7.

    Returns:
        The signature, and the top left pixels of the accepted 4 x 4 blocks in the order of acceptance.

    Raises:
        PictureError: if the picture has another shape or type.
        SignatureError: if the point is not inside the picture or its surroundings are too dark.
    """
    frame = TeachFrame.of(checked(picture))
    x, y = point
    if not (0 <= x < WIDTH and 0 <= y < HEIGHT):
        raise SignatureError(f"the point {x},{y} is not inside the {WIDTH} x {HEIGHT} picture")
    blocks = grow(frame, (x, y), threshold)
    return _signature(frame, [(bx, by, BLOCK, BLOCK) for bx, by in blocks], sig), blocks


def _signature(frame: TeachFrame, rectangles: list[tuple[int, int, int, int]], sig: int) -> Signature:
    """Signature of all quads in some rectangles."""
    quads = [frame.quads(*rectangle) for rectangle in rectangles]
    samples: IntArray = np.concatenate([chroma for _, chroma in quads])
    if not len(samples):
        raise SignatureError("the taught place is too dark; give it more light or choose another one")
    colors: IntArray = np.concatenate([color for color, _ in quads])
    u_min, u_max, u_mean = bounds(samples[:, 0])
    v_min, v_max, v_mean = bounds(samples[:, 1])
    red, green, blue = (colors.sum(axis=0) // len(colors)).tolist()
    return Signature(sig, u_min, u_max, u_mean, v_min, v_max, v_mean, packed(red, green, blue))


def load_signatures(path: str | Path) -> list[Signature]:
    """Read a YAML or JSON file with a list `signatures`, as `save_signatures` writes it.

    Raises:
        SignatureError: if the file can't be read, holds no signatures, or one is wrong or doubled.
    """
    content = read_yaml(path, refuse=SignatureError, remedy="teach one with 'formation teach'")
    listed = content.get("signatures") if isinstance(content, Mapping) else None
    if not isinstance(listed, list) or not listed:
        raise SignatureError(f"{path}: holds no signatures (a list 'signatures'); make one with 'formation teach'")
    signatures = [Signature.from_mapping(item, where=str(path)) for item in listed]
    try:
        return sorted_unique(signatures)
    except SignatureError as error:
        raise SignatureError(f"{path}: {error}") from None


def save_signatures(path: str | Path, signatures: Iterable[Signature]) -> None:
    """Write signatures as YAML, or as JSON if the file's name ends so.

    Raises:
        SignatureError: if a number occurs twice or the file can't be written.
    """
    content = {"signatures": [signature.to_mapping() for signature in sorted_unique(signatures)]}
    is_json = Path(path).suffix.lower() == ".json"
    text = json.dumps(content, indent=2) + "\n" if is_json else yaml.safe_dump(content, sort_keys=False)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise SignatureError(f"{path}: can't be written ({error.strerror}); choose another place") from error


def sorted_unique(signatures: Iterable[Signature]) -> list[Signature]:
    """Sort signatures by number.

    Raises:
        SignatureError: if a number occurs twice.
    """
    ordered = sorted(signatures, key=lambda signature: signature.sig)
    for one, other in itertools.pairwise(ordered):
        if one.sig == other.sig:
            raise SignatureError(f"signature {one.sig} is given twice; keep one of them")
    return ordered
