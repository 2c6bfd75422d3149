"""Pictures of a Koopman matrix, on axes of the caller's or new ones: eigenvalues in the complex plane, and modes."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.analysis.plotting import new_figure
from robot_formation.analysis.style import AUXILIARY, BLUE, ORANGE, VERMILION, styled
from robot_formation.koopman.edmd import EDMD
from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, as_matrix
from robot_formation.koopman.online_dmd import OnlineDMD
from robot_formation.koopman.regressor import KoopmanRegressor
from robot_formation.koopman.spectrum import Spectrum, spectrum
from robot_formation.koopman.windowed_dmd import WindowedDMD

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FittedModel = EDMD | KoopmanRegressor | OnlineDMD | WindowedDMD | Matrix
"""What has a Koopman matrix: a fitted model, or the matrix K (k, k) itself."""

FARTHEST = 2.0
"""Parts of eigenvalues beyond this are drawn at the picture's edge."""
_ON_CIRCLE = 1e-9  # what is less outside the unit circle is rounding
_MOST_NAMED = 12  # values of a state; modes of more are lines over their numbers


@styled
def plot_spectrum(model: FittedModel, axes: Axes | None = None) -> Axes:
    """Draw the Koopman eigenvalues in the complex plane, with the unit circle; those outside of it have a colour.

    Args:
        model: a fitted model, or K (k, k).
        axes: where to draw; None for a new figure, which is `.figure` of what is returned.

    Returns:
        The axes.

    Raises:
        KoopmanError: if the model isn't fitted, or K isn't square.
    """
    values = _decomposed(model).eigenvalues
    if axes is None:
        axes = new_figure(4.6, 4.4).subplots()
    draw_unit_circle(axes)
    growing = np.abs(values) > 1.0 + _ON_CIRCLE
    scatter_eigenvalues(axes, values, c=np.where(growing, VERMILION, BLUE), s=40)
    return axes


@styled
def plot_modes(model: FittedModel, axes: Axes | Sequence[Axes] | None = None, *, most: int = 3) -> list[Axes]:
    """Draw Koopman modes, real and imaginary part over the values of the state, by falling modulus of the eigenvalue.

    Of a conjugate pair only one mode is drawn: the other is its conjugate.

    Args:
        model: a fitted model, or K (k, k), whose observables are the state then.
        axes: where to draw, one for each mode; None for a new figure of at most `most` modes.
        most: how many modes a new figure shows.

    Returns:
        The axes that were drawn on, one for each mode: fewer than were given if there are fewer modes.

    Raises:
        KoopmanError: if the model isn't fitted, K isn't square, or `most` is no positive whole number.
    """
    if not isinstance(most, Integral) or most < 1:
        raise KoopmanError(f"a figure of modes shows one or more, not {most!r}")
    found = _decomposed(model)
    modes, names = _modes_of(model, found)
    drawn = [j for j, value in enumerate(found.eigenvalues) if value.imag >= 0.0]
    if axes is None:
        count = min(most, len(drawn))
        panels = list(new_figure(1.0 + 3.2 * count, 3.2).subplots(1, count, squeeze=False)[0])
    else:
        panels = list(np.ravel(np.asarray(axes, dtype=object)))
    panels = panels[: len(drawn)]
    for panel, j in zip(panels, drawn, strict=False):
        _draw_mode(panel, complex(found.eigenvalues[j]), modes[:, j], names)
    return panels


def draw_unit_circle(axes: Axes) -> None:
    """Draw the unit circle and the axes of the complex plane."""
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(np.cos(turn), np.sin(turn), color=AUXILIARY, linewidth=1.0)
    axes.axhline(0.0, color=AUXILIARY, linewidth=0.6)
    axes.axvline(0.0, color=AUXILIARY, linewidth=0.6)


def scatter_eigenvalues(axes: Axes, values: NDArray[np.complex128], **style: Any) -> Any:
    """Draw eigenvalues as points and label the plane; those far away lie at its edge, and a note says how many.

    Args:
        axes: see `draw_unit_circle`.
        values: eigenvalues, any number.
        style: further arguments of matplotlib's `scatter`.

    Returns:
        The points, for a colour bar; None without any.
    """
    shown, reach = None, 1.15
    if values.size:
        inside = np.clip(values.real, -FARTHEST, FARTHEST), np.clip(values.imag, -FARTHEST, FARTHEST)
        shown = axes.scatter(*inside, edgecolors="black", linewidths=0.4, zorder=3, **style)
        beyond = int(((np.abs(values.real) > FARTHEST) | (np.abs(values.imag) > FARTHEST)).sum())
        if beyond:
            axes.set_title(f"{beyond} beyond {FARTHEST:g}, at the edge", loc="right", fontsize=8)
        reach = max(reach, 1.08 * float(np.abs(inside).max()))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="real part", ylabel="imaginary part")
    return shown


def _draw_mode(axes: Axes, eigenvalue: complex, mode: NDArray[np.complex128], names: Sequence[str]) -> None:
    places = np.arange(len(mode))
    parts = [("real part", mode.real, BLUE)]
    if eigenvalue.imag != 0.0:
        parts.append(("imaginary part", mode.imag, ORANGE))
    axes.axhline(0.0, color=AUXILIARY, linewidth=0.6)
    for i, (label, values, colour) in enumerate(parts):
        if len(mode) > _MOST_NAMED:
            axes.plot(places + 1, values, color=colour, label=label)
        else:
            width = 0.7 / len(parts)
            axes.bar(places + width * (i - (len(parts) - 1) / 2.0), values, width, color=colour, label=label)
    if len(mode) > _MOST_NAMED:
        axes.set_xlabel("value of the state")
    else:
        axes.set_xticks(places, names)
    axes.set(title=_in_words(eigenvalue), ylabel="mode")
    if len(parts) > 1:
        axes.legend()


def _in_words(eigenvalue: complex) -> str:
    """Write an eigenvalue, and with its conjugate its modulus and period."""
    if eigenvalue.imag == 0.0:
        return f"eigenvalue {eigenvalue.real:.3g}"
    period = 2.0 * np.pi / abs(np.angle(eigenvalue))
    pair = f"{eigenvalue.real:.3g} ± {eigenvalue.imag:.3g}i"
    return f"eigenvalues {pair}\nmodulus {abs(eigenvalue):.3g}, period {period:.3g} steps"


def _decomposed(model: FittedModel | ArrayLike) -> Spectrum:
    if isinstance(model, KoopmanRegressor):
        return model.model_.spectrum
    if isinstance(model, EDMD):
        return model.spectrum
    if isinstance(model, (OnlineDMD, WindowedDMD)):
        if not model.fitted:
            raise KoopmanError(f"this {type(model).__name__} is not fitted yet: call update with pairs first")
        model = model.k
    return spectrum(as_matrix(model, "K"))


def _modes_of(model: FittedModel | ArrayLike, found: Spectrum) -> tuple[NDArray[np.complex128], Sequence[str]]:
    """Return modes (n, k) of the state and the names of its values."""
    names: Sequence[str] | None = None
    if isinstance(model, KoopmanRegressor):
        names = getattr(model, "feature_names_in_", None)
        model = model.model_
    if not isinstance(model, EDMD):
        return found.right, [f"x{i + 1}" for i in range(len(found.right))]
    rows = model.dictionary.state_rows
    known = [f"x{i + 1}" if row is None else model.dictionary.names[row] for i, row in enumerate(rows)]
    return model.modes, known if names is None else list(names)
