"""Classes from outside the package, by 'module:Class': what they need, what they may leave out, what is wrong."""

import importlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from robot_formation import plugins
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.scenario import load_track, override
from robot_formation.geometry.se2 import Motion
from robot_formation.koopman.predictors import PredictionError, Predictor, PredictorParameters
from robot_formation.koopman.predictors.outside import OutsideModel
from robot_formation.leader.paths import make_path
from robot_formation.leader.paths.base import Given
from robot_formation.leader.paths.outside import completed_path
from robot_formation.parameters import ParameterError
from robot_formation.surface import make_surface, plate_size, surface_from_texts
from robot_formation.surface.outside import completed_surface
from robot_formation.testing import check_path, check_predictor, check_sensor, check_surface
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.sensors import is_outside_sensor, made_sensor

STEP = np.array([0.01, 0.05, 0.1])


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A module 'mine' in the working directory, which is not on the path."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry])
    yield tmp_path / "mine.py"
    sys.modules.pop("mine", None)


def test_an_entry_point_does_not_take_the_name_of_one_of_the_packages_own_sensors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = {name: plugins.Plugin(name, "mine:Sensor", "mine 1") for name in ("tags", "other")}
    monkeypatch.setattr(plugins, "installed", lambda kind: found)
    assert not is_outside_sensor("tags")
    assert is_outside_sensor("other")


class Least:
    """Two methods, two numbers."""

    def __init__(self) -> None:
        self.last = np.zeros(3)

    def observe(self, displacement: np.ndarray) -> None:
        self.last = displacement

    def forecast(self) -> list[float]:
        return [self.last[0], self.last[1]]


class Ahead(Least):
    """A row for each timestep: the last displacement grows."""

    def forecast(self, steps: int) -> np.ndarray:  # type: ignore[override]
        return np.outer(np.arange(1, steps + 1), self.last)


class Keeping(Least):
    """Has a state of its own."""

    def state(self) -> list[float]:
        return [float(value) for value in self.last]

    def restore(self, state: list[float]) -> None:
        self.last = np.array(state)


def model(kind: type) -> OutsideModel:
    found = OutsideModel("mine", kind)
    found.observe(STEP)
    return found


def test_a_predictor_needs_two_methods_only() -> None:
    found = model(Least)
    assert np.array_equal(found.ahead(3), np.tile([0.01, 0.05, 0.0], (3, 1)))
    check_predictor(Least)


def test_a_predictor_may_forecast_a_row_for_each_timestep() -> None:
    assert np.array_equal(model(Ahead).ahead(3), np.outer([1, 2, 3], STEP))
    check_predictor(Ahead)


@pytest.mark.parametrize("kind", [Least, Keeping])
def test_a_predictor_goes_on_from_its_state(kind: type) -> None:
    other = OutsideModel("mine", kind)
    other.restore(model(kind).state())
    assert np.array_equal(other.ahead(2), model(kind).ahead(2))
    check_predictor(kind)


def test_a_timestep_without_a_camera_is_the_predictors_own_forecast() -> None:
    found = model(Ahead)
    found.advance()
    assert np.array_equal(found.ahead(1)[0], STEP)


class NoForecast:
    def observe(self, displacement: np.ndarray) -> None:
        pass


class Needing(Least):
    def __init__(self, gain: float) -> None:
        self.gain = gain


class Failing(Least):
    def forecast(self) -> list[float]:
        raise ZeroDivisionError("division\nby zero")


class Endless(Least):
    def forecast(self) -> list[float]:
        return [float("nan"), 0.05]


class Short(Least):
    def forecast(self) -> list[float]:
        return [0.05]


class Drifting(Least):
    count = 0

    def forecast(self) -> list[float]:
        Drifting.count += 1
        return [0.0, 0.001 * Drifting.count]


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (NoForecast, "no method 'forecast'"),
        (Needing, "making one without arguments failed: TypeError"),
        (Failing, "forecast failed: ZeroDivisionError: division"),
        (Endless, "two or three finite numbers"),
        (Short, "two or three finite numbers"),
        (Drifting, "the next forecast depends on the horizon"),
    ],
)
def test_the_check_of_predictors_says_in_one_line_what_is_wrong(kind: type, says: str) -> None:
    with pytest.raises(AssertionError) as error:
        check_predictor(kind)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_predictor_in_the_working_directory_runs_also_with_its_residual_closed(module: Path) -> None:
    module.write_text(
        "class Mine:\n"
        "    def observe(self, displacement):\n        self.last = displacement\n"
        "    def forecast(self):\n        return self.last[:2]\n"
    )
    runs = {}
    for name in ("mine:Mine", "previous", "mine:Mine+close", "previous+close"):
        settings = [f"predictor.name={name}", "fine_tuner.mode=paper", "leader.timesteps=6"]
        scenario = override(load_track("two"), [*settings, "world.camera.mode=on_demand"])
        scenario.check()
        found = run_in_memory(scenario).followers[0].displacements
        runs[name] = [(x.motion.x_m, x.motion.y_m) for x in found]
    assert runs["mine:Mine"] == runs["previous"]
    assert runs["mine:Mine+close"] == runs["previous+close"]
    assert runs["previous"] != runs["previous+close"]


@pytest.mark.parametrize(
    ("text", "name", "says"),
    [
        ("", "mine:Mine", "module 'mine' has no 'Mine'"),
        ("Mine = 3\n", "mine:Mine", "is no class"),
        (
            "import nowhere_at_all\n",
            "mine:Mine",
            "can't be imported: it needs the module 'nowhere_at_all', which is not installed",
        ),
        ("import email.nowhere_at_all\n", "mine:Mine", "it needs the module 'email.nowhere_at_all', which is not"),
        ("import sys\nsys.exit(7)\n", "mine:Mine", "can't be imported: SystemExit: 7"),
        ("[].argv\n", "mine:Mine", "can't be imported: AttributeError: 'list' object has no"),
        ("Mine = None\n", "mine:Mine", "module 'mine' has no 'Mine'"),
        ("raise ValueError('not\\ntoday')\n", "mine:Mine", "can't be imported: ValueError: not"),
        ("", "yours:Mine", "no module 'yours'; modules are looked for among the installed ones and in the working"),
        ("", "email.yours:Mine", "no module 'email.yours'; modules are looked for"),
        (
            "class Mine:\n    def __init__(self):\n        exit(7)\n    observe = forecast = exit\n",
            "mine:Mine",
            "SystemExit: 7",
        ),
    ],
)
def test_a_class_that_cant_be_loaded_is_told_in_one_line(module: Path, text: str, name: str, says: str) -> None:
    module.write_text(text)
    with pytest.raises(ParameterError) as error:
        Predictor(PredictorParameters(name=name))
    assert str(error.value).startswith(f"predictor '{name}'")
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["formation+close", "mine", "mine:", ":Mine", "mine:Mine:Mine", ""])
def test_a_name_of_no_known_form_is_refused_before_anything_is_imported(name: str) -> None:
    with pytest.raises(ParameterError, match="can't be"):
        override(load_track("two"), [f"predictor.name='{name}'"])


def test_a_predictor_that_fails_in_a_run_says_so(module: Path) -> None:
    module.write_text(
        "class Mine:\n"
        "    def observe(self, displacement):\n        pass\n"
        "    def forecast(self):\n        return 1 / 0\n"
    )
    found = Predictor(PredictorParameters(name="mine:Mine"))
    with pytest.raises(plugins.PluginError, match="predictor 'mine:Mine': forecast failed: ZeroDivisionError"):
        found.observe(STEP)
    with pytest.raises(PredictionError, match="nothing to predict from"):
        found.predict()


def test_a_surface_needs_heights_only(module: Path) -> None:
    module.write_text(
        "from dataclasses import dataclass\n"
        "@dataclass(frozen=True)\n"
        "class Slope:\n"
        "    rise: float = 0.05\n"
        "    def height(self, x, y):\n        return self.rise * x\n"
        "class Flat:\n"
        "    size_m = 2.5\n"
        "    def height(self, x, y):\n        return 0\n"
        "class Nothing:\n    pass\n"
        "class Made:\n"
        "    def __init__(self):\n        self.rise = 0.1\n"
        "    def height(self, x, y):\n        return self.rise * y\n"
    )
    surface = surface_from_texts("mine:Slope", ["rise=0.1", "size_m=3"])
    assert surface.size_m == 3.0
    assert surface.gradient(0.3, 0.4) == pytest.approx((0.1, 0.0), abs=1e-9)
    assert surface.heights(np.array([[0.0, 1.0]]), np.array([[0.5], [0.7]])).shape == (2, 2)
    assert surface.name == "mine:Slope"
    assert plate_size("mine:Flat") == 2.5
    check_surface(sys.modules["mine"].Slope)
    check_surface(sys.modules["mine"].Made)
    assert (make_surface("mine:Made").height(0.0, 1.0), plate_size("mine:Made")) == (0.1, 1.78)
    check_surface(sys.modules["mine"].Flat)
    with pytest.raises(ParameterError, match="did you mean 'rise'"):
        surface_from_texts("mine:Slope", ["raise=0.1"])
    with pytest.raises(ParameterError, match="no method 'height'"):
        make_surface("mine:Nothing")
    with pytest.raises(ParameterError, match="did you mean 'bowl'"):
        make_surface("bowll")


class Steep:
    def height(self, x: float, y: float) -> float:
        return 0.1 * x

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        return 0.2, 0.0


def test_the_check_of_surfaces_compares_slopes_with_heights() -> None:
    with pytest.raises(AssertionError, match="Steep: 'gradient' is not that of 'height'"):
        check_surface(Steep)


def test_a_path_needs_motions_only(module: Path) -> None:
    module.write_text(
        "class Mine:\n"
        "    aside_m = 0.01\n"
        "    def motion(self, timestep):\n        return 0.05, self.aside_m * (-1) ** timestep\n"
        "class Wrong:\n    def motion(self, timestep):\n        return 'ahead'\n"
        "class Endless:\n    def motion(self, timestep):\n        return float('inf'), 0\n"
    )
    path = make_path("mine:Mine")
    assert path.motion(2) == Motion(0.05, 0.01)
    check_path(sys.modules["mine"].Mine)
    for name, says in (("Wrong", "the motion of timestep 1 failed: ValueError"), ("Endless", "is not finite")):
        with pytest.raises(ParameterError, match=says):
            make_path(f"mine:{name}").motion(1)


class Remembering:
    def __init__(self) -> None:
        self.x_m = 0.0

    def motion(self, timestep: int) -> tuple[float, float]:
        self.x_m += 0.01
        return self.x_m, 0.0


def test_the_check_of_paths_finds_motions_that_depend_on_the_order() -> None:
    with pytest.raises(AssertionError, match="depends on which were asked for before"):
        check_path(Remembering)


class Middle:
    def detect(self, picture: np.ndarray) -> list[tuple[int, float, float, float, float]]:
        return [(1, 158, 104, 50, 50)]


class Fifth(Middle):
    def detect(self, picture: np.ndarray) -> list[tuple[int, float, float, float, float]]:
        return [(5, 158, 104, 50, 50)]


class Words:
    def detect(self, picture: np.ndarray) -> list[str]:
        return ["red"]


def test_a_sensor_needs_blocks_of_a_picture_only() -> None:
    sensor = made_sensor("mine", Middle, DetectorParameters(block_filtering=0))
    picture = np.zeros((208, 316, 3), np.uint8)
    sensor.process(picture, 0)
    (block,) = sensor.process(picture, 16_667)
    assert (block.signature, block.x, block.y, block.width, block.height) == (1, 158, 104, 50, 50)
    check_sensor(Middle)
    with pytest.raises(AssertionError, match="Fifth: signature 5"):
        check_sensor(Fifth)
    with pytest.raises(AssertionError, match="sensor 'Words': detect failed: ValueError"):
        check_sensor(Words)


@dataclass
class Thawed:
    step_m: float = 0.05

    def motion(self, timestep: int) -> tuple[float, float]:
        return self.step_m, 0.0

    def height(self, x: float, y: float) -> float:
        return self.step_m


@pytest.mark.parametrize(("kind", "completed"), [("path", completed_path), ("surface", completed_surface)])
def test_a_dataclass_whose_parameters_can_change_is_refused(kind: str, completed: Callable[[str, type], type]) -> None:
    says = rf"^{kind} 'mine': write @dataclass\(frozen=True\), so that its parameters can't change in a run$"
    with pytest.raises(plugins.PluginError, match=says):
        completed("mine", Thawed)


@dataclass(frozen=True)
class Picky:
    step_m: float = 0.05
    sides: int = 4

    def __post_init__(self) -> None:
        if self.sides == 3:
            raise ArithmeticError("three sides")

    def motion(self, timestep: int) -> tuple[float, float]:
        return self.step_m, 0.0

    def prepared(self, given: Given) -> "Picky":
        return {4: self}[self.sides]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sides=3", "making one failed: ArithmeticError: three sides"),
        ("sides=5", "'prepared' failed: KeyError: 5"),
        ("sids=5", "did you mean 'sides'"),
    ],
)
def test_a_value_that_a_path_itself_refuses_is_told(text: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "load", lambda kind, name: Picky)
    name = f"{__name__}:Picky"
    assert make_path(name).motion(1) == Motion(0.05)
    with pytest.raises(ParameterError, match=says):
        make_path(name, [text])


def test_a_class_of_a_notebook_that_is_defined_anew_is_the_new_one(monkeypatch: pytest.MonkeyPatch) -> None:
    notebook = sys.modules["__main__"]
    for height_m in (0.1, 0.2):

        class Terrace:
            level_m = height_m

            def height(self, x: float, y: float) -> float:
                return self.level_m

        monkeypatch.setattr(notebook, "Terrace", Terrace, raising=False)
        assert make_surface("__main__:Terrace").height(0.0, 0.0) == height_m
    for kind in (Least, Ahead):
        monkeypatch.setattr(notebook, "Mine", kind, raising=False)
        assert plugins.load("predictor", "__main__:Mine") is kind


def test_a_class_of_a_module_that_is_loaded_again_is_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    file = tmp_path / "loaded_again.py"
    file.write_text("class Mine:\n    number = 1\n")
    assert vars(plugins.load("predictor", "loaded_again:Mine"))["number"] == 1
    file.write_text("class Mine:\n    number = 22\n")
    importlib.reload(sys.modules["loaded_again"])
    try:
        assert vars(plugins.load("predictor", "loaded_again:Mine"))["number"] == 22
    finally:
        del sys.modules["loaded_again"]
