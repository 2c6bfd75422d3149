"""Checks for classes of your own: what the package asks of predictors, surfaces, paths and sensors.

Call one in a test of your package: `check_predictor(MyPredictor)`. Each makes the class without arguments and raises an
AssertionError that says what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robot_formation.koopman.predictors.horizon import MOST_STEPS
from robot_formation.koopman.predictors.outside import OutsideModel
from robot_formation.leader.paths.base import Given
from robot_formation.leader.paths.outside import completed_path
from robot_formation.plugins import PluginError
from robot_formation.surface.outside import completed_surface
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH
from robot_formation.vision.sensors import made_sensor

_TIMESTEPS = 40
_SLOPE_ACCURACY = 1e-5
_SLOPE_STEP_M = 1e-6
_FRAME_US = 16_667


def check_predictor(cls: type) -> None:
    """Check a predictor: it is made without arguments, observes displacements, and forecasts finite ones.

    Checked on a straight, a turning and a noisy sequence: forecasts of every horizon, the same answers for the same
    displacements, no change of what it is shown, and going on from a stored state.

    Raises:
        AssertionError: saying what is wrong.
    """
    for name, shown in _sequences().items():
        _check(partial(_check_forecasts, shown=shown), cls, f", {name} displacements")


def check_surface(cls: type) -> None:
    """Check a surface: finite heights everywhere, slopes that fit them, unit normals, arrays as single places.

    Raises:
        AssertionError: saying what is wrong.
    """
    _check(_check_ground, cls)


def check_path(cls: type) -> None:
    """Check a path: a finite motion for every timestep that doesn't depend on what was asked before.

    Raises:
        AssertionError: saying what is wrong.
    """
    _check(_check_motions, cls)


def check_sensor(cls: type) -> None:
    """Check a sensor: blocks of three signatures within the picture, the same for the same pictures.

    Raises:
        AssertionError: saying what is wrong.
    """
    _check(_check_blocks, cls)


def _check(check: Callable[[type], None], cls: type, when: str = "") -> None:
    try:
        check(cls)
    except PluginError as error:
        raise AssertionError(str(error)) from error
    except AssertionError as error:
        raise AssertionError(f"{cls.__name__}{when}: {error}") from None


def _sequences() -> dict[str, NDArray[np.float64]]:
    """Displacements (timesteps, 3): u, v [m], turn [rad]."""
    timesteps = np.arange(_TIMESTEPS)
    straight = np.tile([0.0, 0.05, 0.0], (_TIMESTEPS, 1))
    angle = 2.0 * math.pi * timesteps / 12.0
    turning = np.stack([0.03 * np.sin(angle), 0.05 + 0.01 * np.cos(angle), 0.05 * np.cos(angle)], axis=1)
    noise = np.random.default_rng(1).normal(0.0, [0.004, 0.002, 0.01], (_TIMESTEPS, 3))
    return {"straight": straight, "turning": turning, "noisy": straight + noise}


def _check_forecasts(cls: type, shown: NDArray[np.float64]) -> None:
    first, second = OutsideModel(cls.__name__, cls), OutsideModel(cls.__name__, cls)
    answers = []
    for x in shown:
        before = x.copy()
        first.observe(x)
        assert np.array_equal(x, before), "'observe' changes the displacement that it is shown"
        answers.append(first.ahead(MOST_STEPS))
        assert np.array_equal(first.ahead(1)[0], answers[-1][0]), "the next forecast depends on the horizon"
    for x, answer in zip(shown, answers, strict=True):
        second.observe(x)
        assert np.array_equal(second.ahead(MOST_STEPS), answer), "two of it answer the same displacements differently"
    third = OutsideModel(cls.__name__, cls)
    third.restore(first.state())
    first.advance()
    third.advance()
    assert np.array_equal(third.ahead(MOST_STEPS), first.ahead(MOST_STEPS)), "it goes on differently from its state"


def _check_ground(cls: type) -> None:
    surface = completed_surface(cls.__name__, cls)()
    size_m = surface.size_m
    assert size_m > 0.0, "'size_m' is not positive"
    places = np.random.default_rng(1).uniform(-0.2 * size_m, 1.2 * size_m, (50, 2))
    heights = np.array([float(surface.height(float(x), float(y))) for x, y in places])
    assert np.isfinite(heights).all(), "a height is not finite; heights are asked for beyond the plate's edge too"
    arrays = surface.heights(places[:, 0], places[:, 1])
    assert np.allclose(arrays, heights, rtol=0.0, atol=1e-9), "'heights' differs from 'height'"
    for x, y in places.tolist():
        slope_x, slope_y = (float(slope) for slope in surface.gradient(x, y))
        d = _SLOPE_STEP_M
        along_x = (surface.height(x + d, y) - surface.height(x - d, y)) / (2.0 * d)
        along_y = (surface.height(x, y + d) - surface.height(x, y - d)) / (2.0 * d)
        fits = math.hypot(along_x - slope_x, along_y - slope_y) < _SLOPE_ACCURACY * (1.0 + math.hypot(slope_x, slope_y))
        assert fits, f"'gradient' is not that of 'height' at ({x:.3f}, {y:.3f})"
        normal = np.array(surface.normal(x, y))
        expected = np.array([-slope_x, -slope_y, 1.0]) / math.sqrt(1.0 + slope_x**2 + slope_y**2)
        assert np.allclose(normal, expected, atol=1e-9), f"'normal' doesn't fit 'gradient' at ({x:.3f}, {y:.3f})"


def _check_motions(cls: type) -> None:
    kind = completed_path(cls.__name__, cls)
    path, other = kind().prepared(Given()), kind().prepared(Given())
    last = path.timesteps or _TIMESTEPS
    motions = [path.motion(timestep) for timestep in range(1, last + 1)]
    for timestep in reversed(range(1, last + 1)):
        same = other.motion(timestep) == motions[timestep - 1]
        assert same, f"the motion of timestep {timestep} depends on which were asked for before"


def _check_blocks(cls: type) -> None:
    random = np.random.default_rng(1)
    pictures = [np.zeros((HEIGHT, WIDTH, 3), np.uint8), random.integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)]
    for edge in (20, 50):
        pictures.append(np.full((HEIGHT, WIDTH, 3), 120, np.uint8))
        pictures[-1][80 : 80 + edge, 130 : 130 + edge] = (205, 14, 16)
    sensor = made_sensor(cls.__name__, cls, DetectorParameters(block_filtering=0))
    answers = []
    for _ in range(2):
        sensor.reset()
        found = []
        for number, picture in enumerate(pictures * 2):
            before = picture.copy()
            found.append(sensor.process(picture, number * _FRAME_US))
            assert np.array_equal(picture, before), "it changes the picture that it is shown"
        answers.append(found)
    assert answers[0] == answers[1], "it answers the same pictures differently after 'reset'"
    for block in (block for blocks in answers[0] for block in blocks):
        assert block.signature in (1, 2, 3), f"signature {block.signature}; faces are 1, 2 and 3"
        assert 0 <= block.x < WIDTH, "a block's centre lies beyond the picture"
        assert 0 <= block.y < HEIGHT, "a block's centre lies beyond the picture"
