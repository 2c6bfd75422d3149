"""Follows robots by their white dots from above: which dot is whose, also when some are hidden for a while."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.surface import Surface
from robot_formation.vision.overhead.assignment import assign
from robot_formation.vision.overhead.camera_calibration import Locator
from robot_formation.vision.overhead.dots import find_dots
from robot_formation.vision.overhead.tracking_parameters import OverheadTrackingParameters

Array = NDArray[np.float64]


@dataclass
class DotTrack:
    """A robot's dot: where it was last seen, where it is expected in the next picture, pictures since it was seen.

    Places are (3,) in the world, metres; `step` is the smoothed displacement per picture.
    """

    place: Array
    expected: Array
    step: Array
    missed: int = 0

    def seen(self, place: Array, gain: float) -> None:
        """Register where the dot is now."""
        self.step = self.step + gain * ((place - self.place) / (self.missed + 1) - self.step)
        self.place, self.expected, self.missed = place, place + self.step, 0

    def unseen(self) -> None:
        """Go on expecting; what is known of its speed fades."""
        self.missed += 1
        self.step = 0.7 * self.step
        self.expected = self.expected + self.step


class OverheadTracker:
    """From pictures to the places of named dots.

    Each robot keeps the dot that is nearest to where its own is expected, robots and dots paired so that the sum of
    squared distances is least. A robot whose dot is not found keeps its last place until a dot appears within reach
    that is nobody else's; its reach grows by the gate with every picture. If dots are missing where they are expected,
    but there is one near every robot's start, then the robots have been put back.

    Attributes:
        tracks: what is known of each robot's dot.
        restarted: whether the last picture showed the robots put back to their starts.
    """

    def __init__(
        self, parameters: OverheadTrackingParameters, surface: Surface, starts: Mapping[str, tuple[float, float]]
    ) -> None:
        """Begin with robots' starts: base_link's (x, y) in the world, metres, by name."""
        self.configure(parameters, surface, starts)
        self.tracks: dict[str, DotTrack] = {}
        self.restarted = False
        self.restart()

    def configure(
        self, parameters: OverheadTrackingParameters, surface: Surface, starts: Mapping[str, tuple[float, float]]
    ) -> None:
        """Set other parameters for the same robots, from the next picture on; tracks go on."""
        self._parameters = parameters
        self._locator = Locator(parameters.chosen(), surface, parameters.dot_height_m)
        self._starts = {name: self._locator.place_of(x, y) for name, (x, y) in starts.items()}

    def restart(self) -> None:
        """Expect all robots at their starts again."""
        self.tracks = {name: DotTrack(place, place, np.zeros(3)) for name, place in self._starts.items()}

    def update(self, picture: NDArray[np.uint8]) -> dict[str, Array]:
        """Process the next picture, uint8 (rows, columns); return the places (3,) of the robots found in it."""
        if not self.tracks:
            return {}
        p = self._parameters
        middle = np.mean([track.expected for track in self.tracks.values()], axis=0)
        pixels = find_dots(picture, p.threshold, self._locator.area_px(middle, p.dot_radius_m))
        places = self._locator.places(pixels)
        self.restarted = self._put_back(places)
        if self.restarted:
            self.restart()
        found: dict[str, Array] = {}
        for name, column in self._owners(places).items():
            track = self.tracks[name]
            if column is None:
                track.unseen()
            else:
                track.seen(places[column], p.velocity_gain)
                found[name] = places[column]
        return found

    def _put_back(self, places: Array) -> bool:
        """Whether all dots are near the robots' starts, but not all near where they are expected."""

        def all_found(centres: list[Array]) -> bool:
            squares = _squares(np.array(centres), places)
            return None not in assign(squares, self._parameters.gate_m**2)

        if all_found([track.expected for track in self.tracks.values()]):
            return False
        return all_found(list(self._starts.values()))

    def _owners(self, places: Array) -> dict[str, int | None]:
        """Assign each robot its dot (a row of `places`), if it has one."""
        names, gate = list(self.tracks), self._parameters.gate_m
        expected = np.array([self.tracks[name].expected for name in names])
        squares = _squares(expected, places)
        owners = dict(zip(names, assign(squares, gate**2), strict=True))
        missing = [row for row, name in enumerate(names) if owners[name] is None]
        free = [column for column in range(len(places)) if column not in owners.values()]
        if not missing or not free:
            return owners
        # A robot that was hidden may have moved in each picture since, but takes no dot from one that was not.
        reach = np.array([gate * (1 + self.tracks[names[row]].missed) for row in missing])
        rest = squares[np.ix_(missing, free)]
        rest = np.where(rest <= reach[:, None] ** 2, rest, np.inf)
        for row, column in zip(missing, assign(rest, float(reach.max()) ** 2), strict=True):
            owners[names[row]] = None if column is None else free[column]
        return owners


def _squares(expected: Array, places: Array) -> Array:
    """Squared distances (n, m) in x, y of places (n, 3) and (m, 3)."""
    return np.asarray(np.sum((expected[:, None, :2] - places[None, :, :2]) ** 2, axis=2))
