"""Parameter objects are checked, complete and the same in YAML, ROS and code."""

import math
from dataclasses import FrozenInstanceError, dataclass, fields, is_dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.components.catalogue import KINDS
from robot_formation.parameters import (
    ParameterError,
    flatten,
    from_mapping,
    parameter,
    specs,
    suggestion,
    to_mapping,
)


@dataclass(frozen=True)
class Wheel:
    radius_m: float = parameter(0.03, "Radius", unit="m", low=0.01, high=0.1)
    name: str = parameter("mecanum", "Kind", choices=("mecanum", "omni"))


@dataclass(frozen=True)
class Car:
    count: int = parameter(4, "Wheels", low=1, high=8)
    fast: bool = parameter(False, "Whether it is fast")
    curve: tuple[float, ...] = parameter((0.0, 1.0), "Curve", low=-5.0, high=5.0)
    gears: tuple[int, ...] = parameter((1, 2), "Gears", low=1)
    riders: tuple[str, ...] = parameter((), "Riders")
    wheel: Wheel = Wheel()


def build(**values: Any) -> Car:
    return from_mapping(Car, values, where="car.yaml")


def test_specs_list_nested_parameters_by_dotted_name_with_all_that_is_known() -> None:
    found = specs(Car)
    assert list(found) == ["count", "fast", "curve", "gears", "riders", "wheel.radius_m", "wheel.name"]
    radius = found["wheel.radius_m"]
    assert (radius.type, radius.default, radius.unit, radius.low, radius.high) == (float, 0.03, "m", 0.01, 0.1)
    assert radius.description == "Radius"
    assert found["wheel.name"].choices == ("mecanum", "omni")


def test_nothing_given_means_the_defaults() -> None:
    assert build() == Car()


def test_nested_and_dotted_names_mean_the_same() -> None:
    nested = build(wheel={"radius_m": 0.05}, count=3)
    assert nested == from_mapping(Car, {"wheel.radius_m": 0.05, "count": 3}, where="car.yaml")
    assert nested == Car(count=3, wheel=Wheel(radius_m=0.05))


cars = st.builds(
    Car,
    count=st.integers(1, 8),
    fast=st.booleans(),
    curve=st.lists(st.floats(-5.0, 5.0), min_size=1).map(tuple),
    gears=st.lists(st.integers(1), min_size=1).map(tuple),
    riders=st.lists(st.text()).map(tuple),
    wheel=st.builds(Wheel, st.floats(0.01, 0.1), st.sampled_from(["mecanum", "omni"])),
)


@given(car=cars)
def test_a_mapping_and_back_gives_the_same_object(car: Car) -> None:
    flat = to_mapping(car)
    assert set(flat) == set(specs(Car))
    assert not any(isinstance(value, tuple) for value in flat.values())
    assert from_mapping(Car, flat, where="test") == car


def test_flatten_joins_names_with_dots() -> None:
    assert flatten({"a": {"b": {"c": 1}, "d": [2]}, "e": None}) == {"a.b.c": 1, "a.d": [2], "e": None}


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"cout": 3}, "car.yaml: no parameter 'cout'; did you mean 'count'?"),
        ({"wheel": {"radius": 0.05}}, "car.yaml: no parameter 'wheel.radius'; did you mean 'wheel.radius_m'?"),
        ({"radius_m": 0.05}, "car.yaml: no parameter 'radius_m'; did you mean 'wheel.radius_m'?"),
        ({"xyz": 1}, "there are: count, curve, fast, gears, riders, wheel.name, wheel.radius_m"),
        ({"count": "3"}, "car.yaml: 'count' must be of type int, not '3'"),
        ({"count": 3.0}, "'count' must be of type int, not 3.0"),
        ({"count": True}, "'count' must be of type int, not True"),
        ({"count": None}, "'count' must be of type int, not None"),
        ({"count": [3]}, "'count' must be of type int, not [3]"),
        ({"count": 9}, "'count' is 9, outside 1 to 8"),
        ({"count": 0}, "'count' is 0, outside 1 to 8"),
        ({"fast": 1}, "'fast' must be of type bool, not 1"),
        ({"fast": "yes"}, "'fast' must be of type bool, not 'yes'"),
        ({"wheel": {"radius_m": "5 cm"}}, "'wheel.radius_m' must be of type float, not '5 cm'"),
        ({"wheel": {"radius_m": True}}, "'wheel.radius_m' must be of type float, not True"),
        ({"wheel": {"radius_m": 0.2}}, "'wheel.radius_m' is 0.2, outside 0.01 to 0.1 m"),
        ({"wheel": {"radius_m": math.nan}}, "'wheel.radius_m' must be finite, not nan"),
        ({"wheel": {"radius_m": -math.inf}}, "'wheel.radius_m' must be finite, not -inf"),
        ({"wheel": {"radius_m": 10**400}}, "'wheel.radius_m' must be finite, not inf"),
        ({"wheel": {"name": "omi"}}, "'wheel.name' can't be 'omi'; did you mean 'omni'?"),
        ({"wheel": 3}, "no parameter 'wheel'"),
        ({"curve": 1.0}, "'curve' must be a list, not 1.0"),
        ({"curve": []}, "'curve' must not be empty"),
        ({"curve": "12"}, "'curve' must be a list, not '12'"),
        ({"curve": [1.0, "2"]}, "'curve' must be of type float, not '2'"),
        ({"curve": [1.0, 6.0]}, "'curve' is 6.0, outside -5.0 to 5.0"),
        ({"curve": [math.nan]}, "'curve' must be finite, not nan"),
        ({"gears": [1, 2.0]}, "'gears' must be of type int, not 2.0"),
        ({"gears": [0]}, "'gears' is 0, outside 1 to inf"),
        ({"riders": ["Ann", 3]}, "'riders' must be of type str, not 3"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(values: dict[str, Any], text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        build(**values)
    assert text in str(caught.value)
    assert str(caught.value).startswith("car.yaml: ")
    assert "\n" not in str(caught.value)


def test_whole_numbers_are_taken_for_floats_and_become_floats() -> None:
    found = build(wheel={"radius_m": 0.1}, curve=[1, 2])
    assert found.curve == (1.0, 2.0)
    assert all(type(value) is float for value in found.curve)


def test_the_ends_of_a_range_are_inside() -> None:
    assert build(count=8, wheel={"radius_m": 0.01}) == Car(count=8, wheel=Wheel(radius_m=0.01))


def test_an_empty_list_is_refused_where_the_default_has_values() -> None:
    with pytest.raises(ParameterError, match="'gears' must not be empty"):
        build(gears=[])


def test_parameter_objects_do_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        build().count = 5  # type: ignore[misc]


def test_checks_of_the_class_itself_are_reached() -> None:
    world = KINDS["world"].parameter_class()
    with pytest.raises(ParameterError, match="must divide physics_hz = 240"):
        from_mapping(world, {"camera": {"min_frames_per_second": 50}}, where="test")


def test_without_any_name_there_is_no_suggestion() -> None:
    assert suggestion("x", []) == ""


# --- every node's parameters ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_parameter_of_a_node_has_a_description_and_a_default_that_passes_its_own_check(kind: str) -> None:
    cls = KINDS[kind].parameter_class()
    for spec in specs(cls).values():
        assert spec.description, spec.name
    assert from_mapping(cls, to_mapping(cls()), where=kind) == cls()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_names_and_units_of_a_nodes_parameters_agree(kind: str) -> None:
    endings = {"_m": "m", "_s": "s", "_rad": "rad", "_deg": "deg", "_px": "px", "_hz": "Hz", "_rad_s": "rad/s"}
    for name, spec in specs(KINDS[kind].parameter_class()).items():
        for ending, unit in endings.items():
            leaf = name.rsplit(".", 1)[-1]
            longer = any(leaf.endswith(other) and len(other) > len(ending) for other in endings)
            if leaf.endswith(ending) and not longer and "_per_" not in leaf and "_m_s" not in leaf:
                assert spec.unit == unit or unit in spec.unit, name


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_numbers_of_a_node_have_a_range_so_that_absurd_ones_are_refused(kind: str) -> None:
    free = {"camera.centre_x_px", "camera.centre_y_px", "calibration.v", "calibration.u", "calibration.turn"}
    lists = {"start_x_m", "start_y_m", "start_heading_rad"}
    for name, spec in specs(KINDS[kind].parameter_class()).items():
        if spec.type in (int, float) and not spec.choices and name not in free | lists:
            assert spec.low is not None, name
            assert spec.high is not None, name
            assert spec.low <= spec.default <= spec.high


def test_nested_parameters_are_dataclasses_all_the_way() -> None:
    for kind in KINDS.values():
        cls = kind.parameter_class()
        assert is_dataclass(cls)
        assert all(field.metadata or is_dataclass(field.default) for field in fields(cls))


def test_a_nested_dataclass_keeps_the_defaults_that_its_owner_gives_it() -> None:
    @dataclass(frozen=True)
    class Inner:
        a: float = parameter(1.0, "a")
        b: float = parameter(2.0, "b")

    @dataclass(frozen=True)
    class Middle:
        inner: Inner = Inner(a=5.0)

    @dataclass(frozen=True)
    class Outer:
        plain: Inner = Inner()
        own: Inner = Inner(a=3.0)
        middle: Middle = Middle(inner=Inner(b=7.0))

    globals().update(Inner=Inner, Middle=Middle)  # annotations are resolved by name
    try:
        assert {name: spec.default for name, spec in specs(Outer).items()} == to_mapping(Outer())
        assert from_mapping(Outer, {"own.b": 4.0}, where="test") == Outer(own=Inner(a=3.0, b=4.0))
        assert from_mapping(Outer, {"middle.inner.a": 9.0}, where="test").middle.inner == Inner(a=9.0, b=7.0)
    finally:
        del globals()["Inner"], globals()["Middle"]


def test_former_names_of_parameters_are_still_taken() -> None:
    from robot_formation.components.catalogue import KINDS
    from robot_formation.parameters import FORMER_NAMES, specs

    known = {name for kind in KINDS.values() for name in specs(kind.parameter_class())}
    assert set(FORMER_NAMES.values()) <= known
    assert known.isdisjoint(FORMER_NAMES)
    assert flatten({"formation": {"handicap": 2.0}}) == {"formation.initial_loss": 2.0}
    with pytest.raises(ParameterError, match="given twice"):
        flatten({"formation.handicap": 2.0, "formation.initial_loss": 1.0})
