import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.parameters import ParameterError
from robot_formation.surface import PLATE_SIZE_M, SURFACES, Surface, make_surface

anywhere = st.floats(-0.5, PLATE_SIZE_M + 0.5)


@pytest.fixture(params=sorted(SURFACES))
def surface(request):
    return make_surface(request.param)


def test_a_surface_has_the_protocol_and_its_registered_name(surface):
    assert isinstance(surface, Surface)
    assert SURFACES[surface.name] is type(surface)
    assert surface.size_m == PLATE_SIZE_M


@pytest.mark.parametrize("name", sorted(SURFACES))
@settings(deadline=None, max_examples=50)
@given(x=anywhere, y=anywhere)
def test_gradient_is_the_derivative_of_height_also_beyond_the_edge(name, x, y):
    surface = make_surface(name)
    step = 1e-6
    slope_x, slope_y = surface.gradient(x, y)
    assert slope_x == pytest.approx((surface.height(x + step, y) - surface.height(x - step, y)) / (2 * step), abs=1e-7)
    assert slope_y == pytest.approx((surface.height(x, y + step) - surface.height(x, y - step)) / (2 * step), abs=1e-7)


@pytest.mark.parametrize("name", sorted(SURFACES))
@settings(deadline=None, max_examples=50)
@given(x=anywhere, y=anywhere)
def test_normal_is_a_unit_vector_that_points_up_across_the_gradient(name, x, y):
    surface = make_surface(name)
    n_x, n_y, n_z = surface.normal(x, y)
    slope_x, slope_y = surface.gradient(x, y)
    assert math.hypot(n_x, n_y, n_z) == pytest.approx(1.0, abs=1e-12)
    assert n_z > 0.0
    assert n_x + slope_x * n_z == pytest.approx(0.0, abs=1e-12)
    assert n_y + slope_y * n_z == pytest.approx(0.0, abs=1e-12)


def test_arrays_give_the_same_heights_as_single_points_and_broadcast(surface):
    xs = np.linspace(-0.2, 2.0, 7)[:, None]
    ys = np.linspace(-0.2, 2.0, 5)[None, :]
    expected = [[surface.height(float(x), float(y)) for y in ys[0]] for x in xs[:, 0]]
    assert surface.heights(xs, ys) == pytest.approx(np.array(expected), abs=1e-12)


def test_scalar_methods_return_plain_floats(surface):
    values = (surface.height(0.3, 0.4), *surface.gradient(0.3, 0.4), *surface.normal(0.3, 0.4))
    assert all(type(value) is float for value in values)


def test_the_bowl_has_the_papers_heights():
    bowl = make_surface("bowl")
    assert bowl.height(0.89, 0.89) == pytest.approx(0.050)
    assert bowl.height(0.0, 0.0) == pytest.approx(0.2084, abs=5e-5)
    assert bowl.height(1.78, 0.0) == pytest.approx(0.2084, abs=5e-5)
    assert math.degrees(math.atan(math.hypot(*bowl.gradient(0.0, 0.0)))) == pytest.approx(14.1, abs=0.05)


def test_the_plane_lies_at_the_height_asked_for():
    assert make_surface("plane", {"height_m": 0.3}).height(5.0, -5.0) == 0.3


def test_a_wrong_name_suggests_the_near_one():
    with pytest.raises(ParameterError, match="did you mean 'bowl'"):
        make_surface("bowll")


def test_a_wrong_parameter_suggests_the_near_one():
    with pytest.raises(ParameterError, match=r"surface 'plane'.*did you mean 'height_m'"):
        make_surface("plane", {"heigth_m": 0.1})
