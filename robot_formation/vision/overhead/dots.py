"""Finds white dots in the overhead camera's picture, to a small part of a pixel."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMALLEST, LARGEST = 0.6, 1.5
"""Area of a whole single dot, in expected ones: below, something covers it; above, dots touch."""
_PAD_PX = 2
_ROUNDS = 20


def find_dots(picture: NDArray[np.uint8], threshold: int, area_px: float) -> Array:
    """Return the centres (n, 2) (column, row) of all whole dots in a grey picture.

    A dot that is cut off by the picture's edge or mostly covered has its centre elsewhere, so it isn't reported. A
    spot as large as several dots is split into as many.

    Args:
        picture: uint8 (rows, columns).
        threshold: grey level between the dots and everything else.
        area_px: expected area of one dot.
    """
    _, white = cv2.threshold(picture, threshold, 255, cv2.THRESH_BINARY)
    # Contours of a few spots take a tenth of the time of labelling the whole picture.
    contours, _ = cv2.findContours(white, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    rows, columns = picture.shape
    centres: list[Array] = []
    for contour in contours:
        left, top, width, height = cv2.boundingRect(contour)
        cut_off = left == 0 or top == 0 or left + width == columns or top + height == rows
        if cut_off or width * height < SMALLEST * area_px:
            continue
        x, y = max(0, left - _PAD_PX), max(0, top - _PAD_PX)
        part = (slice(y, top + height + _PAD_PX), slice(x, left + width + _PAD_PX))
        _, labels = cv2.connectedComponents(white[part], connectivity=8)
        inside = labels == labels[contour[0, 0, 1] - y, contour[0, 0, 0] - x]
        area = int(np.count_nonzero(inside))
        if area < SMALLEST * area_px:
            continue
        corner = np.array([x, y], float)
        if area <= LARGEST * area_px:
            centres.append(_centroid(picture[part], inside | (labels == 0), threshold) + corner)
        else:
            spot = np.argwhere(inside)[:, ::-1].astype(float)
            centres.extend(_split(spot, round(area / area_px)) + corner)
    return np.array(centres).reshape(-1, 2)


def _centroid(picture: NDArray[np.uint8], counted: NDArray[np.bool_], threshold: int) -> Array:
    """Centre (column, row) of a spot weighted by its light, so that pixels on its edge count by their share."""
    weights = np.maximum(picture - 0.5 * threshold, 0.0) * counted
    rows, columns = np.arange(picture.shape[0]), np.arange(picture.shape[1])
    return np.asarray(np.array([weights.sum(axis=0) @ columns, weights.sum(axis=1) @ rows]) / weights.sum())


def _split(pixels: Array, count: int) -> Array:
    """Centres (count, 2) of the touching discs that pixels (n, 2) make up: k-means (Lloyd) from starts far apart."""
    first = pixels[np.argmax(np.sum((pixels - pixels.mean(axis=0)) ** 2, axis=1))]
    centres = [first]
    while len(centres) < count:
        nearest = np.min([np.sum((pixels - centre) ** 2, axis=1) for centre in centres], axis=0)
        centres.append(pixels[np.argmax(nearest)])
    found = np.array(centres)
    for _ in range(_ROUNDS):
        owner = np.argmin(np.sum((pixels[:, None, :] - found[None]) ** 2, axis=2), axis=1)
        found = np.array([pixels[owner == k].mean(axis=0) for k in range(count)])
    return found
