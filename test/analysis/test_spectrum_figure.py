"""Eigenvalues and modes are drawn where they lie, on the caller's axes or on new ones."""

from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgba

from robot_formation.analysis import plot_modes, plot_spectrum
from robot_formation.analysis.plotting import new_figure
from robot_formation.analysis.style import BLUE, VERMILION
from robot_formation.koopman import (
    EDMD,
    Identity,
    KoopmanError,
    KoopmanRegressor,
    NotFittedError,
    OnlineDMD,
    WindowedDMD,
)

K = np.array([[0.9, -0.3, 0.0], [0.3, 0.9, 0.0], [0.0, 0.0, 1.1]])
X = np.random.default_rng(0).normal(size=(30, 3))


def models() -> dict[str, Any]:
    online, windowed = OnlineDMD(3), WindowedDMD(3, 10)
    for x in X:
        online.update(x, K @ x)
        windowed.update(x, K @ x)
    return {
        "matrix": K,
        "edmd": EDMD.fit(Identity(3), X.T, K @ X.T),
        "regressor": KoopmanRegressor().fit(X, X @ K.T),
        "online": online,
        "windowed": windowed,
    }


@pytest.mark.parametrize("kind", models())
def test_every_kind_of_model_shows_its_eigenvalues_and_which_grow(kind: str) -> None:
    axes = plot_spectrum(models()[kind])
    points: Any = axes.collections[0]
    assert points.get_offsets().data == pytest.approx(np.array([[1.1, 0.0], [0.9, 0.3], [0.9, -0.3]]), abs=1e-9)
    assert [tuple(colour) for colour in points.get_facecolors()] == [to_rgba(c) for c in (VERMILION, BLUE, BLUE)]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("real part", "imaginary part", 1.0)


def test_eigenvalues_far_away_lie_at_the_edge_and_are_counted() -> None:
    axes = plot_spectrum(np.diag([5.0, 0.5]))
    points: Any = axes.collections[0]
    assert points.get_offsets().data.tolist() == [[2.0, 0.0], [0.5, 0.0]]
    assert axes.get_title(loc="right") == "1 beyond 2, at the edge"


def bars_of(axes: Any) -> list[float]:
    return [bar.get_height() for bar in axes.patches]


@pytest.mark.parametrize("kind", models())
def test_of_a_conjugate_pair_one_mode_is_drawn_with_both_parts(kind: str) -> None:
    growing, turning = plot_modes(models()[kind])
    assert growing.get_title() == "eigenvalue 1.1"
    assert turning.get_title() == "eigenvalues 0.9 ± 0.3i\nmodulus 0.949, period 19.5 steps"
    heights = bars_of(growing)
    assert heights == pytest.approx([0.0, 0.0, heights[2]], abs=1e-9)
    assert abs(heights[2]) > 0.1
    bars = np.array(bars_of(turning)).reshape(2, 3)
    mode = bars[0] + 1j * bars[1]
    assert K @ mode == pytest.approx((0.9 + 0.3j) * mode, abs=1e-9)
    assert [text.get_text() for text in turning.get_xticklabels()] == ["x1", "x2", "x3"]


def test_given_axes_are_drawn_on_and_take_as_many_modes() -> None:
    left, right = new_figure(6.0, 3.0).subplots(1, 2)
    assert plot_spectrum(K, left) is left
    assert plot_modes(K, right) == [right]
    assert len(plot_modes(K, new_figure(6.0, 3.0).subplots(2, 2))) == 2  # there are no more
    assert len(plot_modes(K, most=1)) == 1


def test_modes_of_long_states_are_lines_and_names_are_those_of_the_dictionary() -> None:
    model = KoopmanRegressor(Identity(3, ["angle", "rate", "drift"])).fit(X, X @ K.T)
    assert [text.get_text() for text in plot_modes(model)[0].get_xticklabels()] == ["angle", "rate", "drift"]
    places = np.linspace(0.0, 1.0, 20)
    path = np.array([0.9**t * places + 0.5**t * (1.0 - places) for t in range(12)])
    first, second = plot_modes(KoopmanRegressor(rank=2).fit(path), most=2)
    for axes, shape in ((first, places), (second, 1.0 - places)):
        line = np.asarray(axes.lines[-1].get_ydata())
        assert line / line[10] == pytest.approx(shape / shape[10], abs=1e-6)
        assert axes.get_xlabel() == "value of the state"


def test_what_has_no_k_is_refused() -> None:
    with pytest.raises(NotFittedError, match="call fit first"):
        plot_spectrum(KoopmanRegressor())
    with pytest.raises(KoopmanError, match="square"):
        plot_modes(OnlineDMD(2, outputs=3, prior_weight=1.0))
    with pytest.raises(KoopmanError, match="one or more"):
        plot_modes(K, most=0)
    with pytest.raises(KoopmanError, match="one or more, not 'a'"):
        plot_modes(K, most="a")  # type: ignore[arg-type]
    for plot in (plot_spectrum, plot_modes):
        with pytest.raises(KoopmanError, match=r"one row at least .* \(0, 0\)"):
            plot(np.zeros((0, 0)))
        with pytest.raises(KoopmanError, match="real numbers"):
            plot([[1.0, 2.0], [3.0]])  # type: ignore[arg-type]


@pytest.mark.parametrize("make", [lambda **prior: OnlineDMD(2, **prior), lambda **prior: WindowedDMD(2, 5, **prior)])
def test_online_models_are_drawn_once_they_have_learned_from_a_pair_or_a_prior(make: Any) -> None:
    model = make()
    for plot in (plot_spectrum, plot_modes):
        with pytest.raises(KoopmanError, match="DMD is not fitted yet: call update with pairs first"):
            plot(model)
    model.update([1.0, 0.0], [0.5, 0.0])
    for fitted in (model, type(model).from_state(model.state()), make(prior_weight=1.0)):
        assert plot_spectrum(fitted).collections
