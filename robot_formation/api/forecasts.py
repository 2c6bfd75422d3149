"""Predictors on displacements of one's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.analysis.displacement_log import DisplacementLog
from robot_formation.analysis.forecasts import forecast_log
from robot_formation.analysis.limits import FARTHEST
from robot_formation.api.inputs import whole_number
from robot_formation.api.scenarios import settings_of
from robot_formation.errors import FormationError
from robot_formation.experiment.predictor_choice import chosen_predictors, defaults
from robot_formation.experiment.scenario import with_values

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Forecasts:
    """A predictor's forecasts on n displacements; `forecast` makes it.

    Attributes:
        predictor: its name.
        means: (n, 2) forecast of each timestep from those before it, (u, v), metres; NaN in the first row.
        covariances: (n, 2, 2) of what comes about the forecast, square metres; NaN in the first row.
        targets: (n, 2) what came: the ideal moves (displacement plus residual), or the displacements where there are no
            residuals at all; metres.
        errors: number, RMSE, median and largest error in metres, and the share inside the 90 % ellipse.
        errors_ahead: the same of the ways of 1, 2, ... `horizon` timesteps, each with its `h`.
        ahead: (horizon, 3) forecasts of the timesteps after the last one, (u, v, turn), metres and radians.
        ahead_covariances: (horizon, 3, 3) of these.
        model: what the predictor has learned in the end: `k`, `eigenvalues`, `weights` and more; None where it has
            none.
    """

    predictor: str
    means: Array
    covariances: Array
    targets: Array
    errors: Mapping[str, float | None]
    errors_ahead: tuple[Mapping[str, float | None], ...]
    ahead: Array
    ahead_covariances: Array
    model: Mapping[str, Any]

    def __repr__(self) -> str:
        """Return the essentials in a line."""
        rmse = self.errors["rmse"]
        said = "no errors" if rmse is None else f"RMSE {1e3 * rmse:.2f} mm"
        return f"<Forecasts of {self.predictor!r}, {len(self.means)} timesteps, {said}>"


def forecast(
    predictor: str,
    displacements: ArrayLike,
    horizon: int = 1,
    *,
    residuals: ArrayLike | None = None,
    commanded: ArrayLike | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Forecasts:
    """Show a predictor displacements one by one, and ask it for each before it is shown.

    Args:
        predictor: a name of `predictors()`, or `module:Class`.
        displacements: (n, 2) net displacement of each timestep, (u, v) in metres; or (n, 3) with the turn in radians.
        horizon: how many timesteps ahead, 1 to 50.
        residuals: (n, 2) what was left to go at each end, metres; a row of NaN where unknown.
        commanded: (n, 2) what the displacement would have been had the robot gone as told, metres; NaN as before.
        settings: the predictor's parameters, like `{"predictor.forgetting": 0.95}`.

    Raises:
        FormationError: naming what is misspelt, or the array and the timestep that can't be used.
    """
    values = settings_of(settings)
    scenario = with_values(defaults(), values, source="settings")
    keys = [key for key, _ in values]
    (parameters,) = chosen_predictors([str(predictor)], scenario, keys, named="predictor", source="settings")
    horizon = whole_number("horizon", horizon, 1, FARTHEST)
    log = _log(displacements, residuals, commanded)
    found = forecast_log(log, parameters, horizon)
    return Forecasts(
        parameters.name,
        found.means_m,
        found.covariances_m2,
        log.targets_m,
        found.error_m,
        found.horizon,
        np.array([ahead.mean for ahead in found.ahead]),
        np.array([ahead.covariance for ahead in found.ahead]),
        found.model,
    )


def _log(displacements: ArrayLike, residuals: ArrayLike | None, commanded: ArrayLike | None) -> DisplacementLog:
    moved = _array("displacements", displacements)
    if moved.ndim != 2 or moved.shape[1] not in (2, 3) or not len(moved):
        raise FormationError(
            f"displacements are an array (n, 2) of u and v, or (n, 3) with the turn too, not {moved.shape}"
        )
    others = []
    for name, given in (("residuals", residuals), ("commanded", commanded)):
        found = np.full((len(moved), 2), np.nan) if given is None else _array(name, given)
        if found.shape != (len(moved), 2):
            raise FormationError(f"{name} is an array ({len(moved)}, 2), a row per displacement, not {found.shape}")
        _check_rows(name, found)
        others.append(found)
    turns = moved[:, 2] if moved.shape[1] == 3 else np.zeros(len(moved))
    places = tuple(f"timestep {t}" for t in range(1, len(moved) + 1))
    return DisplacementLog("displacements", places, moved[:, :2], others[0], others[1], turns)


def _check_rows(name: str, rows: Array) -> None:
    """Refuse rows of which one number only is known, and infinite ones."""
    wrong = np.isinf(rows).any(axis=1) | (np.isnan(rows).any(axis=1) & ~np.isnan(rows).all(axis=1))
    if wrong.any():
        first = int(np.argmax(wrong))
        raise FormationError(
            f"{name}, timestep {first + 1}: {rows[first].tolist()} is neither finite nor NaN for all of the row"
        )


def _array(name: str, values: ArrayLike) -> Array:
    try:
        return np.array(values, float)
    except (TypeError, ValueError):
        raise FormationError(f"{name} is an array of numbers in metres, a row per timestep") from None
