"""Surfaces from outside the package that fail or return something wrong: one line that names them."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from robot_formation.parameters import ParameterError
from robot_formation.plugins import PluginError
from robot_formation.surface import make_surface, plate_size, surface_from_texts
from robot_formation.surface.outside import completed_surface

PLACES = np.array([0.1, 0.2])


class Flat:
    def height(self, x: float, y: float) -> float:
        return 0.0


class Raising:
    def height(self, x: float, y: float) -> float:
        return x / 0.0


class Leaving:
    def height(self, x: float, y: float) -> float:
        raise SystemExit(3)


class Words:
    def height(self, x: float, y: float) -> str:
        return "high"


class Several:
    def height(self, x: float, y: float) -> np.ndarray:
        return np.array([x, y])


class Endless:
    def height(self, x: float, y: float) -> float:
        return math.nan


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (Raising, "the height at (0.25, 1) failed: ZeroDivisionError: "),
        (Leaving, "the height at (0.25, 1) failed: SystemExit: 3"),
        (Words, "the height at (0.25, 1) failed: ValueError: could not convert string"),
        (Several, "the height at (0.25, 1) failed: TypeError: "),
        (Endless, "the height at (0.25, 1) failed: ValueError: nan is not finite"),
    ],
)
def test_a_wrong_height_is_told_in_one_line_that_names_surface_and_place(kind: type, says: str) -> None:
    surface = completed_surface("mine", kind)()
    with pytest.raises(PluginError) as error:
        surface.height(0.25, 1.0)
    assert str(error.value).startswith(f"surface 'mine': {says}")
    assert "\n" not in str(error.value)
    for derived in (surface.gradient, surface.normal):
        with pytest.raises(PluginError, match="surface 'mine': the height at"):
            derived(0.25, 1.0)
    with pytest.raises(PluginError, match="surface 'mine': the height at"):
        surface.heights(PLACES, PLACES)


class Slopes(Flat):
    def gradient(self, x: float, y: float) -> tuple[float, ...]:
        return 0.0, 0.0, 0.0


class Sloping(Flat):
    def gradient(self, x: float, y: float) -> float:
        return 0.0


class Normals(Flat):
    def normal(self, x: float, y: float) -> tuple[float, ...]:
        return 0.0, math.inf, 1.0


@pytest.mark.parametrize(
    ("kind", "method", "says"),
    [
        (Slopes, "gradient", r"the gradient at \(0, 1\) failed: ValueError: 2 numbers are expected, not 3"),
        (Sloping, "gradient", r"the gradient at \(0, 1\) failed: TypeError"),
        (Normals, "normal", r"the normal at \(0, 1\) failed: ValueError: inf is not finite"),
    ],
)
def test_a_wrong_slope_or_normal_is_told(kind: type, method: str, says: str) -> None:
    with pytest.raises(PluginError, match=says):
        getattr(completed_surface("mine", kind)(), method)(0.0, 1.0)


class Scalar(Flat):
    def heights(self, xs: np.ndarray, ys: np.ndarray) -> float:
        return 0.0


class Holes(Flat):
    def heights(self, xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
        return np.full(xs.shape, np.nan)


@pytest.mark.parametrize(("kind", "says"), [(Scalar, r"shape \(2,\) is expected, not \(\)"), (Holes, "finite")])
def test_wrong_arrays_of_heights_are_told(kind: type, says: str) -> None:
    with pytest.raises(PluginError, match=f"surface 'mine': 'heights' failed: ValueError: .*{says}"):
        completed_surface("mine", kind)().heights(PLACES, PLACES)


class Big(Flat):
    size_m = "big"


class Negative(Flat):
    size_m = -3.0


class Made(Flat):
    def __init__(self) -> None:
        self.size_m = math.nan


class Asked(Flat):
    @property
    def size_m(self) -> float:
        return 1 / 0


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (Big, "'size_m' is 'big'; it must be a number of metres, 0.1 to 100"),
        (Negative, "'size_m' is -3.0; it must be"),
        (Made, "'size_m' is nan; it must be"),
        (Asked, "'size_m' failed: ZeroDivisionError"),
    ],
)
def test_a_wrong_size_is_refused(kind: type, says: str) -> None:
    with pytest.raises(PluginError, match=f"surface 'mine': {says}"):
        completed_surface("mine", kind)


@dataclass(frozen=True)
class Tiled(Flat):
    tiles: int = 4
    size_m: float = 2.0

    def __post_init__(self) -> None:
        if self.tiles == 3:
            raise ArithmeticError("three tiles")


def test_a_size_or_value_that_is_set_later_is_checked_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robot_formation.plugins.load", lambda kind, name: Tiled)
    name = f"{__name__}:Tiled"
    assert plate_size(name, ["size_m=3"]) == make_surface(name, {"size_m": 3.0}).size_m == 3.0
    for texts, says in ((["size_m=-3"], "'size_m' is -3.0; it must be"), (["tiles=3"], "ArithmeticError: three tiles")):
        for build in (plate_size, surface_from_texts):
            with pytest.raises(ParameterError, match=says):
                build(name, texts)
