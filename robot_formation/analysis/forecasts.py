"""One-step forecasts of every timestep of a displacement log, and how far they were from what came."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.displacement_log import DisplacementLog
from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.quantiles import ELLIPSE_90
from robot_formation.koopman.predictors import PredictionError, Predictor, PredictorParameters

_TABLE = (
    ("n", "rmse_u", "rmse_v", "rmse", "median", "worst", "coverage_90"),
    ("n", "RMSE u", "RMSE v", "RMSE", "median", "worst", "in 90 %"),
    ("", "mm", "mm", "mm", "mm", "mm", "ellipse"),
)


@dataclass(frozen=True)
class OneStepForecasts:
    """A predictor's forecasts for the rows of a log, each made from the rows before it; NaN where there is none.

    Attributes:
        name: the predictor's.
        means_m: (n, 2) forecast ideal move (u, v), metres.
        covariances_m2: (n, 2, 2) of the ideal move about the forecast, square metres.
        error_m: n, RMSE, median and largest |error| in metres, share inside the 90 % ellipse; see `error_statistics`.
    """

    name: str
    means_m: NDArray[np.float64]
    covariances_m2: NDArray[np.float64]
    error_m: Mapping[str, float | None]

    def to_json(self) -> dict[str, object]:
        """Return what the command line's JSON says of a predictor."""
        return {
            "forecast": _rows(self.means_m),
            "covariance": _rows(self.covariances_m2),
            "error_m": dict(self.error_m),
        }


def forecast_log(log: DisplacementLog, parameters: PredictorParameters) -> OneStepForecasts:
    """Show a predictor the log row by row, and ask it for each row before it is shown.

    Raises:
        AnalysisError: the predictor refuses a row, which the text names.
    """
    predictor = Predictor(parameters)
    means, covariances = np.full((len(log), 2), np.nan), np.full((len(log), 2, 2), np.nan)
    for t, place in enumerate(log.places):
        if t > 0:
            forecast = predictor.predict()
            means[t], covariances[t] = forecast.mean, forecast.covariance
        try:
            predictor.observe(log.displacements_m[t], _known(log.residuals_m[t]), _known(log.commanded_m[t]))
        except PredictionError as error:
            raise AnalysisError(
                f"{log.source}, {place}: {error}; correct it (metres), or raise predictor.max_u_m and max_v_m"
            ) from error
    statistics = error_statistics(log.targets_m - means, covariances)
    return OneStepForecasts(parameters.name, means, covariances, statistics)


def error_statistics(errors_m: NDArray[np.float64], covariances_m2: NDArray[np.float64]) -> dict[str, float | None]:
    """Sum up errors (n, 2) with their covariances (n, 2, 2); rows with NaN are left out.

    Returns:
        `n`, the number of errors; `rmse_u`, `rmse_v` and `rmse` (of |e|, so that rmse^2 = rmse_u^2 + rmse_v^2),
        `median` and `worst` |e|, all in metres; `coverage_90`, the share of errors inside their 90 % ellipse. All but
        `n` are None if there are no errors.
    """
    known = np.isfinite(errors_m).all(axis=1)
    errors, covariances = errors_m[known], covariances_m2[known]
    count = len(errors)
    if count == 0:
        return {"n": 0, **dict.fromkeys(_TABLE[0][1:])}
    rmse_u, rmse_v = np.sqrt(np.mean(errors**2, axis=0)).tolist()
    lengths = np.hypot(errors[:, 0], errors[:, 1])
    return {
        "n": count,
        "rmse_u": rmse_u,
        "rmse_v": rmse_v,
        "rmse": float(np.hypot(rmse_u, rmse_v)),
        "median": float(np.median(lengths)),
        "worst": float(lengths.max()),
        "coverage_90": float(np.mean(inside_ellipse(errors, covariances))),
    }


def inside_ellipse(errors_m: NDArray[np.float64], covariances_m2: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return for each error (n, 2) whether it lies in the 90 % ellipse of its covariance (n, 2, 2): (n,).

    e^T C^-1 e <= q is the same as q C - e e^T having no negative eigenvalue (Schur complement), which needs no inverse
    and so holds for a covariance of zero too.
    """
    rest = ELLIPSE_90 * covariances_m2 - errors_m[:, :, None] * errors_m[:, None, :]
    u, v, mixed = rest[:, 0, 0], rest[:, 1, 1], rest[:, 0, 1]
    return np.asarray((u >= 0.0) & (v >= 0.0) & (u * v >= mixed**2))


def error_table(log: DisplacementLog, forecasts: Sequence[OneStepForecasts]) -> str:
    """Return the error table for the terminal, millimetres."""
    target = "the ideal move (displacement + residual)" if log.has_residuals else "the displacement (no residuals)"
    commands = "with" if log.has_commanded else "without"
    head = f"{log.source}: {len(log)} timesteps, {commands} commands; errors of one-step forecasts of {target}"
    width = max(len("predictor"), *(len(forecast.name) for forecast in forecasts))
    keys, names, units = _TABLE
    lines = [_line("predictor", names, width), _line("", units, width)]
    lines.append("-" * len(lines[0]))
    lines += [
        _line(forecast.name, [_cell(key, forecast.error_m[key]) for key in keys], width) for forecast in forecasts
    ]
    return "\n".join([head, "", *lines])


def _rows(values: NDArray[np.float64]) -> list[object]:
    """Turn an array (n, ...) into a list of n, None where there is NaN."""
    return [None if np.isnan(row).any() else row.tolist() for row in values]


def _known(uv_m: NDArray[np.float64]) -> NDArray[np.float64] | None:
    return uv_m if np.isfinite(uv_m).all() else None


def _line(name: str, cells: Sequence[str], width: int) -> str:
    return f"{name:<{width}}" + "".join(f"{cell:>9}" for cell in cells)


def _cell(key: str, value: float | None) -> str:
    if value is None:
        return "-"
    if key == "n":
        return f"{value:d}"
    return f"{value * 100.0:.0f} %" if key == "coverage_90" else f"{value * 1e3:.2f}"
