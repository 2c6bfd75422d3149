import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.parameters import ParameterError
from robot_formation.surface import PLATE_SIZE_M, SURFACES, Surface, make_surface, surface_from_texts

anywhere = st.floats(-0.5, PLATE_SIZE_M + 0.5)
OTHERS = {
    "gaussian_bump": {"height_m": -0.08, "radius_m": 0.2, "centre_x_m": 0.3},
    "ripple": {"direction_deg": 37.0, "wavelength_m": 0.4},
    "inclined_plane": {"slope_deg": 14.0, "direction_deg": -130.0},
    "saddle": {"curvature_per_m": -0.08},
}
CASES: list[tuple[str, dict[str, float]]] = [(name, {}) for name in sorted(SURFACES)] + sorted(OTHERS.items())
every_case = pytest.mark.parametrize(("name", "parameters"), CASES, ids=lambda value: value if value else "")


@pytest.fixture(params=sorted(SURFACES))
def surface(request: pytest.FixtureRequest) -> Surface:
    return make_surface(request.param)


def test_a_surface_has_the_protocol_and_its_registered_name(surface: Surface) -> None:
    assert isinstance(surface, Surface)
    assert SURFACES[surface.name] is type(surface)
    assert surface.size_m == PLATE_SIZE_M


@every_case
@settings(deadline=None, max_examples=50)
@given(x=anywhere, y=anywhere)
def test_gradient_is_the_derivative_of_height_also_beyond_the_edge(
    name: str, parameters: dict[str, float], x: float, y: float
) -> None:
    surface = make_surface(name, parameters)
    step = 1e-6
    slope_x, slope_y = surface.gradient(x, y)
    # The tolerance is what a jump of the curvature at the very place may make of the difference quotient.
    assert slope_x == pytest.approx((surface.height(x + step, y) - surface.height(x - step, y)) / (2 * step), abs=3e-6)
    assert slope_y == pytest.approx((surface.height(x, y + step) - surface.height(x, y - step)) / (2 * step), abs=3e-6)


@every_case
@settings(deadline=None, max_examples=50)
@given(x=anywhere, y=anywhere)
def test_normal_is_a_unit_vector_that_points_up_across_the_gradient(
    name: str, parameters: dict[str, float], x: float, y: float
) -> None:
    surface = make_surface(name, parameters)
    n_x, n_y, n_z = surface.normal(x, y)
    slope_x, slope_y = surface.gradient(x, y)
    assert math.hypot(n_x, n_y, n_z) == pytest.approx(1.0, abs=1e-12)
    assert n_z > 0.0
    assert n_x + slope_x * n_z == pytest.approx(0.0, abs=1e-12)
    assert n_y + slope_y * n_z == pytest.approx(0.0, abs=1e-12)


@every_case
def test_height_and_gradient_are_finite_far_beyond_the_edge_too(name: str, parameters: dict[str, float]) -> None:
    surface = make_surface(name, parameters)
    places = [-100.0, -0.3, 0.0, 0.89, 1.78, 2.1, 100.0]
    values = [value for x in places for y in places for value in (surface.height(x, y), *surface.gradient(x, y))]
    assert all(map(math.isfinite, values))


@every_case
@pytest.mark.parametrize("edge", [0.0, PLATE_SIZE_M])
def test_height_and_gradient_go_on_without_a_jump_past_the_edge(
    name: str, parameters: dict[str, float], edge: float
) -> None:
    surface = make_surface(name, parameters)
    step = 1e-9
    for along in (-0.2, 0.0, 0.31, 0.89, 1.5, PLATE_SIZE_M, 1.9):
        for inside, outside in (
            ((edge - step, along), (edge + step, along)),
            ((along, edge - step), (along, edge + step)),
        ):
            assert surface.height(*inside) == pytest.approx(surface.height(*outside), abs=1e-8)
            assert surface.gradient(*inside) == pytest.approx(surface.gradient(*outside), abs=1e-7)


@pytest.mark.parametrize("name", sorted(SURFACES))
def test_the_default_plate_is_not_too_steep_for_the_default_robot(name: str) -> None:
    surface = make_surface(name)
    ticks = np.linspace(0.0, PLATE_SIZE_M, 60)
    steepest = max(math.hypot(*surface.gradient(float(x), float(y))) for x in ticks for y in ticks)
    assert math.degrees(math.atan(steepest)) < 14.2


def test_arrays_give_the_same_heights_as_single_points_and_broadcast(surface: Surface) -> None:
    xs = np.linspace(-0.2, 2.0, 7)[:, None]
    ys = np.linspace(-0.2, 2.0, 5)[None, :]
    expected = [[surface.height(float(x), float(y)) for y in ys[0]] for x in xs[:, 0]]
    assert surface.heights(xs, ys) == pytest.approx(np.array(expected), abs=1e-12)


def test_scalar_methods_return_plain_floats(surface: Surface) -> None:
    values = (surface.height(0.3, 0.4), *surface.gradient(0.3, 0.4), *surface.normal(0.3, 0.4))
    assert all(type(value) is float for value in values)


def test_the_bowl_has_the_papers_heights() -> None:
    bowl = make_surface("bowl")
    assert bowl.height(0.89, 0.89) == pytest.approx(0.050)
    assert bowl.height(0.0, 0.0) == pytest.approx(0.2084, abs=5e-5)
    assert bowl.height(1.78, 0.0) == pytest.approx(0.2084, abs=5e-5)
    assert math.degrees(math.atan(math.hypot(*bowl.gradient(0.0, 0.0)))) == pytest.approx(14.1, abs=0.05)


def test_the_elliptic_bowl_rises_as_its_curvatures_say() -> None:
    bowl = make_surface("elliptic_bowl")
    assert bowl.height(0.89, 0.89) == 0.05
    assert bowl.height(1.39, 0.89) == pytest.approx(0.05 + 0.06 * 0.25)
    assert bowl.height(0.89, 0.39) == pytest.approx(0.05 + 0.11 * 0.25)


def test_the_saddle_rises_along_x_and_falls_along_y() -> None:
    saddle = make_surface("saddle")
    assert saddle.height(1.39, 0.89) == pytest.approx(0.13 + 0.025)
    assert saddle.height(0.89, 1.39) == pytest.approx(0.13 - 0.025)
    assert saddle.height(0.5, 0.5) == pytest.approx(0.13)


def test_the_bump_has_its_height_in_the_middle_and_its_steepest_slope_at_its_radius() -> None:
    bump = make_surface("gaussian_bump")
    assert bump.height(0.89, 0.89) == pytest.approx(0.15)
    assert bump.height(0.89 + 0.35, 0.89) == pytest.approx(0.05 + 0.1 * math.exp(-0.5))
    assert bump.gradient(0.89 + 0.35, 0.89)[0] == pytest.approx(-0.1 / 0.35 * math.exp(-0.5))


def test_the_ripple_is_3_cm_high_and_60_cm_long() -> None:
    ripple = make_surface("ripple")
    assert ripple.height(0.2, 0.89) - ripple.height(0.2, 0.59) == pytest.approx(0.03)
    assert ripple.height(0.2, 0.89 - 0.6) == pytest.approx(ripple.height(1.5, 0.89))
    slopes = [abs(ripple.gradient(0.3, float(y))[1]) for y in np.linspace(0.0, PLATE_SIZE_M, 500)]
    assert math.degrees(math.atan(max(slopes))) == pytest.approx(8.9, abs=0.05)


def test_the_inclined_plane_rises_by_its_angle_in_its_direction() -> None:
    plane = make_surface("inclined_plane", {"slope_deg": 10.0, "direction_deg": 30.0})
    ahead = (0.89 + 0.5 * math.cos(math.radians(30)), 0.89 + 0.5 * math.sin(math.radians(30)))
    assert plane.height(*ahead) - plane.height(0.89, 0.89) == pytest.approx(0.5 * math.tan(math.radians(10)))
    aside = (0.89 - 0.5 * math.sin(math.radians(30)), 0.89 + 0.5 * math.cos(math.radians(30)))
    assert plane.height(*aside) == pytest.approx(plane.height(0.89, 0.89))


def test_the_plane_lies_at_the_height_asked_for() -> None:
    assert make_surface("plane", {"height_m": 0.3}).height(5.0, -5.0) == 0.3


def test_a_wrong_name_suggests_the_near_one() -> None:
    with pytest.raises(ParameterError, match="did you mean 'bowl'"):
        make_surface("bowll")


def test_a_wrong_parameter_suggests_the_near_one() -> None:
    with pytest.raises(ParameterError, match=r"surface 'plane'.*did you mean 'height_m'"):
        make_surface("plane", {"heigth_m": 0.1})


def test_parameters_can_be_texts_numbers_and_file_names_alike(tmp_path: Path) -> None:
    file = tmp_path / "a=b.npy"
    np.save(file, np.full((4, 4), 0.2))
    surface = surface_from_texts("heightmap", [f"file={file}", "scale_m=0.5", "base_m=0.1"])
    assert surface.height(0.7, 0.7) == pytest.approx(0.2)
    assert surface_from_texts("plane", ["height_m=0.3"]).height(0.0, 0.0) == 0.3


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (["height_m"], "are texts like 'size_m=2.0', not 'height_m'"),
        (["height_m=high"], "'height_m' needs a number, not 'high'"),
        (["heigth_m=1"], "did you mean 'height_m'"),
        (["height_m=nan"], "must be finite"),
    ],
)
def test_a_wrong_text_is_refused_with_one_line(texts: list[str], says: str) -> None:
    with pytest.raises(ParameterError, match=says) as caught:
        surface_from_texts("plane", texts)
    assert "\n" not in str(caught.value)
