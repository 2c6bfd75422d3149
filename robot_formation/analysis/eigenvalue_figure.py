"""Picture of the eigenvalues of K, the finite-dimensional Koopman operator, while a run goes on."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.figures import run_title
from robot_formation.analysis.plotting import new_figure, save_figure
from robot_formation.analysis.quantities import RunAnalysis
from robot_formation.analysis.run_record import FollowerRecord, RunRecord
from robot_formation.analysis.spectrum_figure import FARTHEST, draw_unit_circle, scatter_eigenvalues
from robot_formation.analysis.style import AUXILIARY, styled
from robot_formation.bag.run_details import node_parameters
from robot_formation.koopman.linear_algebra import KoopmanError
from robot_formation.koopman.online_dmd import OnlineDMD
from robot_formation.koopman.spectrum import spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEAST_PAIRS = 2  # fewer don't determine K


@styled
def draw_eigenvalues(record: RunRecord, analysis: RunAnalysis, path: str | Path) -> Path:
    """Draw the eigenvalues of K over the run: in the complex plane with the unit circle, and their moduli.

    K is that of the paper's method, online DMD of the displacements (u, v), whatever the run's predictor was.

    Args:
        record: the run.
        analysis: the same run's quantities.
        path: file to write; an older picture there is replaced.

    Raises:
        AnalysisError: the file can't be written.
    """
    rows = len(record.followers)
    figure = new_figure(8.4, 0.9 + 3.5 * rows)
    figure.get_layout_engine().set(wspace=0.08)
    panels = figure.subplots(rows, 2, squeeze=False, width_ratios=(1.0, 1.15))
    for (plane, moduli), follower in zip(panels, record.followers, strict=True):
        found = eigenvalues_over(follower, forgetting(record))
        eigenvalue_plane(plane, found)
        _moduli(moduli, found)
        if rows > 1:
            plane.set_title(follower.name.replace("_", " "), loc="left")
    figure.suptitle(f"{run_title(record, analysis)}\nEigenvalues of K, online DMD of the displacements", fontsize=11)
    return save_figure(figure, path)


def eigenvalues_over(follower: FollowerRecord, forgetting: float = 1.0) -> list[tuple[int, NDArray[np.complex128]]]:
    """Return K's eigenvalues (2,) by falling modulus after each timestep that determines them, with its number.

    Args:
        follower: whose displacements (u, v) K is learned from.
        forgetting: weight of a pair relative to the next newer one.
    """
    dmd = OnlineDMD(2, forgetting=forgetting)
    found, pairs = [], 0
    moves = [np.array(entry.motion.uv_m) for entry in follower.displacements]
    for t, (before, now) in enumerate(pairwise(moves), 2):
        if not (np.isfinite(before).all() and np.isfinite(now).all()):
            continue
        try:
            dmd.learn(before, now)
            pairs += 1
            if pairs >= _LEAST_PAIRS:
                found.append((t, spectrum(dmd.k).eigenvalues))
        except KoopmanError:
            continue  # displacements of zero have no K
    return found


def forgetting(record: RunRecord) -> float:
    """Return the run's weight of older pairs; 1 where it says none or nonsense."""
    said = node_parameters(record.details).get("predictor", {}).get("forgetting")
    return float(said) if isinstance(said, (int, float)) and 0.0 < said <= 1.0 else 1.0


def eigenvalue_plane(axes: Axes, found: Sequence[tuple[int, NDArray[np.complex128]]]) -> None:
    """Draw eigenvalues (2,) of timesteps in the complex plane with the unit circle, and a colour bar beside it."""
    draw_unit_circle(axes)
    values = np.concatenate([values for _, values in found]) if found else np.empty(0, dtype=complex)
    shown = scatter_eigenvalues(axes, values, c=np.repeat([t for t, _ in found], 2), cmap="cividis", s=26)
    if shown is not None:
        axes.figure.colorbar(shown, ax=axes, label="timestep", shrink=0.8)


def _moduli(axes: Axes, found: Sequence[tuple[int, NDArray[np.complex128]]]) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.axhline(1.0, color=AUXILIARY, linewidth=1.0)
    if found:
        moduli = np.abs([values for _, values in found])
        for column, (marker, label) in enumerate((("o-", "larger"), ("s--", "smaller"))):
            style: dict[str, Any] = {"color": "0.15" if column == 0 else "0.5", "markersize": 3.5, "linewidth": 1.0}
            axes.plot([t for t, _ in found], moduli[:, column], marker, label=label, **style)
        axes.set_ylim(0.0, max(1.2, min(1.08 * float(moduli.max()), 1.5 * FARTHEST)))
        axes.legend(title="modulus", title_fontsize=9, loc="best")
    axes.xaxis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], integer=True))
    axes.set(xlabel="timestep", ylabel="modulus of the eigenvalues")
