"""What is wrong with a taught signature: a colour that can't be told from others, or that a camera can't find."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from robot_formation.vision.pixy2.color_table import ColorTable, is_code, run_time_bounds
from robot_formation.vision.pixy2.matches import matching_signatures
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import Picture
from robot_formation.vision.pixy2.signatures import Signature
from robot_formation.vision.pixy2.teaching import SCALE_BITS

LIKE = DetectorParameters().signature_teach_threshold
"""Chroma distance in 1/32768 within which the camera, when it teaches from a point, takes colours for the same."""
LEAST_LEVELS = 4.0
"""Least width at run time, in levels of a colour channel. A red, green or blue face of 60 px with noise of one level is
found in each of 20 pictures with this width, and in none where it is one level."""
MOST_OF_PICTURE = 0.3
"""Share of the picture: the marker's face covers 4 % in formation, and 7 % where robots touch."""


@dataclass(frozen=True)
class Shortcoming:
    """What is wrong: `kind` is grey, narrow, wide, overlap or fills; the text says what to do."""

    kind: str
    text: str


def shortcomings(
    signature: Signature, others: Iterable[Signature], picture: Picture, parameters: DetectorParameters
) -> list[Shortcoming]:
    """List what is wrong with a signature at its range, nothing if all is well.

    Args:
        signature: what was taught.
        others: the signatures that it is to be used with.
        picture: the picture it was taught from, RGB, shape (208, 316, 3), uint8.
        parameters: the signature ranges.
    """
    return [
        *_grey(signature, parameters),
        *_narrow(signature, parameters),
        *_wide(signature, parameters),
        *_overlaps(signature, others, parameters),
        *_fills(signature, picture, parameters),
    ]


def _bounds(signature: Signature, parameters: DetectorParameters) -> tuple[int, int, int, int]:
    code = is_code(signature, parameters.color_code_mode)
    return run_time_bounds(signature, parameters.range_of(signature.sig), code=code)


def _grey(signature: Signature, parameters: DetectorParameters) -> list[Shortcoming]:
    u_min, u_max, v_min, v_max = _bounds(signature, parameters)
    distance = float(np.hypot(signature.u_mean, signature.v_mean))
    if distance < LIKE:
        text = f"the colour is grey or nearly so ({distance:.0f} from grey, where {LIKE} make another colour)"
    elif u_min < 0 < u_max and v_min < 0 < v_max:
        text = "at its range it takes in grey"
    else:
        return []
    return [Shortcoming("grey", f"{text}: it finds whatever is grey, or nothing; teach a saturated colour")]


def _narrow(signature: Signature, parameters: DetectorParameters) -> list[Shortcoming]:
    u_min, u_max, v_min, v_max = _bounds(signature, parameters)
    total = max(1, sum(signature.rgb >> shift & 0xFF for shift in (16, 8, 0)))
    least = LEAST_LEVELS * (1 << SCALE_BITS) / total
    width = min(u_max - u_min, v_max - v_min)
    if width >= least:
        return []
    return [
        Shortcoming(
            "narrow",
            f"too narrow: {width} wide at its range, where noise of one level takes {least:.0f}; teach on a picture "
            "with the noise and shading of the place, or raise the signature's range",
        )
    ]


def _wide(signature: Signature, parameters: DetectorParameters) -> list[Shortcoming]:
    u_min, u_max, v_min, v_max = _bounds(signature, parameters)
    width = max(u_max - u_min, v_max - v_min)
    if width <= 2 * LIKE:
        return []
    return [
        Shortcoming(
            "wide",
            f"too wide: {width} at its range, where more than {2 * LIKE} are several colours; teach a smaller place "
            "inside one colour, or lower the signature's range",
        )
    ]


def _overlaps(signature: Signature, others: Iterable[Signature], parameters: DetectorParameters) -> list[Shortcoming]:
    own = _bounds(signature, parameters)
    found = []
    for other in others:
        theirs = _bounds(other, parameters)
        if other.sig == signature.sig or not _area(_common(own, theirs)):
            continue
        share = _area(_common(own, theirs)) / min(_area(own), _area(theirs))
        winner = min(signature.sig, other.sig)
        text = f"overlaps signature {other.sig} by {100.0 * share:.0f} % of the smaller one"
        found.append(
            Shortcoming("overlap", f"{text}: signature {winner} gets what both claim; lower one of their ranges")
        )
    return found


def _common(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
    return max(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), min(one[3], other[3])


def _area(bounds: tuple[int, int, int, int]) -> int:
    return max(0, bounds[1] - bounds[0]) * max(0, bounds[3] - bounds[2])


def _fills(signature: Signature, picture: Picture, parameters: DetectorParameters) -> list[Shortcoming]:
    matched = matching_signatures(picture, ColorTable.of([signature], parameters))
    share = float(np.count_nonzero(matched)) / matched.size
    if share <= MOST_OF_PICTURE:
        return []
    return [
        Shortcoming(
            "fills",
            f"it matches {100.0 * share:.0f} % of the picture: is it the background? Teach the object, or lower the "
            "signature's range",
        )
    ]
