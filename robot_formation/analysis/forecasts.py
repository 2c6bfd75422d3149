"""One-step forecasts of every timestep of a displacement log, and how far they were from what came."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.displacement_log import DisplacementLog
from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.quantiles import ELLIPSE_90
from robot_formation.koopman.predictors import Ahead, PredictionError, Predictor, PredictorParameters
from robot_formation.koopman.predictors.models import Diagnostics
from robot_formation.koopman.predictors.spatial import after

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
        horizon: the same of the ways of 1, 2, ... timesteps, with `h`; empty if not asked for.
        ahead: forecasts of the timesteps after the log's last one: as many as were asked for, at least 1.
        model: K and what is known of it at the log's end; see `model_of`.
    """

    name: str
    means_m: NDArray[np.float64]
    covariances_m2: NDArray[np.float64]
    error_m: Mapping[str, float | None]
    horizon: tuple[Mapping[str, float | None], ...] = ()
    ahead: tuple[Ahead, ...] = ()
    model: Mapping[str, object] = field(default_factory=dict)

    def to_json(self) -> dict[str, object]:
        """Return what the command line's JSON says of a predictor."""
        return {
            "forecast": _rows(self.means_m),
            "covariance": _rows(self.covariances_m2),
            "error_m": dict(self.error_m),
            **({"horizon": [dict(found) for found in self.horizon]} if self.horizon else {}),
            **self.model,
        }


def forecast_log(log: DisplacementLog, parameters: PredictorParameters, horizon: int = 0) -> OneStepForecasts:
    """Show a predictor the log row by row, and ask it for each row before it is shown.

    Args:
        log: the log.
        parameters: the predictor's.
        horizon: up to how many timesteps ahead the ways are judged too; 0 for none.

    Raises:
        AnalysisError: the predictor refuses a row, which the text names.
    """
    predictor = Predictor(parameters)
    means, covariances = np.full((len(log), 2), np.nan), np.full((len(log), 2, 2), np.nan)
    ahead: list[list[Ahead]] = []
    turned = bool(log.turns_rad.any())
    for t, place in enumerate(log.places):
        if t > 0:
            forecast = predictor.predict()
            means[t], covariances[t] = forecast.mean[:2], forecast.covariance[:2, :2]
            if horizon:
                ahead.append(predictor.ahead(horizon))
        try:
            displacement = np.append(log.displacements_m[t], log.turns_rad[t])
            predictor.observe(
                displacement, _known(log.residuals_m[t], turned), _known(log.commanded_m[t], False, log.turns_rad[t])
            )
        except PredictionError as error:
            raise AnalysisError(
                f"{log.source}, {place}: {error}; correct it, or raise predictor.max_u_m, max_v_m or max_turn_rad "
                "(lengths are metres, or what --unit says; turns are radians)"
            ) from error
    statistics = error_statistics(log.targets_m - means, covariances)
    horizons = tuple({"h": h, **_way_statistics(log, ahead, h)} for h in range(1, horizon + 1))
    coming = tuple(predictor.ahead(max(horizon, 1)))
    return OneStepForecasts(
        parameters.name, means, covariances, statistics, horizons, coming, model_of(predictor.diagnostics())
    )


def _way_statistics(log: DisplacementLog, ahead: Sequence[Sequence[Ahead]], h: int) -> dict[str, float | None]:
    """Sum up errors of the ways of h timesteps: forecasts after row s against what was driven in rows s+1 to s+h."""
    errors, covariances = [], []
    residuals = log.residuals_m if log.has_residuals else np.zeros_like(log.residuals_m)
    totals = np.column_stack([log.displacements_m, log.turns_rad])
    for start, forecasts in enumerate(ahead, 1):
        if start + h > len(log):
            break
        driven = totals[start]
        for total in totals[start + 1 : start + h]:
            driven = after(driven, total)
        ideal = after(driven, np.append(residuals[start + h - 1], 0.0))
        errors.append((ideal - forecasts[h - 1].way)[:2])
        covariances.append(forecasts[h - 1].way_covariance[:2, :2])
    count = len(errors)
    return error_statistics(np.array(errors).reshape(count, 2), np.array(covariances).reshape(count, 2, 2))


def model_of(diagnostics: Diagnostics) -> dict[str, object]:
    """Return what the command line's JSON says of a model: K, eigenvalues with their periods, weights.

    Returns:
        `k` and `condition_number`; `eigenvalues`, each with `re`, `im`, `modulus`, `period` (timesteps, None if it is
        no oscillation), and `residual`, `noise`, `spurious` as in `EigenvalueQuality` (None with too few rows);
        `consistency_index`; `weights` of experts by axis. None where the model has none.
    """
    k, values = diagnostics.k, diagnostics.eigenvalues
    qualities = diagnostics.qualities
    rows: list[dict[str, object]] | None = None
    if qualities is not None:
        rows = [_eigenvalue(found.eigenvalue, found.residual, found.noise, found.spurious) for found in qualities]
    elif values is not None:
        rows = [_eigenvalue(value, None, None, None) for value in sorted(values.tolist(), key=abs, reverse=True)]
    return {
        "k": None if k is None else k.tolist(),
        "condition_number": _finite(diagnostics.condition_number),
        "eigenvalues": rows,
        "consistency_index": diagnostics.consistency,
        "weights": None if diagnostics.weights is None else {a: dict(w) for a, w in diagnostics.weights.items()},
    }


def _eigenvalue(
    value: complex, residual: float | None, noise: float | None, spurious: bool | None
) -> dict[str, object]:
    angle = abs(float(np.angle(value)))
    return {
        "re": value.real,
        "im": value.imag,
        "modulus": abs(value),
        "period": 2.0 * np.pi / angle if angle > 1e-9 else None,
        "residual": residual,
        "noise": noise,
        "spurious": spurious,
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def best_of(forecasts: Sequence[OneStepForecasts]) -> str | None:
    """Name the predictor of the smallest RMSE; None if nothing can be compared."""
    known = [(found.error_m["rmse"], number) for number, found in enumerate(forecasts)]
    ranked = sorted((rmse, number) for rmse, number in known if rmse is not None)
    return forecasts[ranked[0][1]].name if len(ranked) > 1 else None


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
    best = best_of(forecasts)
    lines = [_line("predictor", names, width), _line("", units, width)]
    lines.append("-" * len(lines[0]))
    lines += [
        _line(forecast.name, [_cell(key, forecast.error_m[key]) for key in keys], width)
        + (" <- least RMSE" if forecast.name == best else "")
        for forecast in forecasts
    ]
    steps = [found["h"] for found in forecasts[0].horizon]
    if steps:
        lines += ["", "RMSE of the way of h timesteps, mm (share inside its 90 % ellipse)"]
        lines.append(f"{'predictor':<{width}}" + "".join(f"{f'h = {h:.0f}':>14}" for h in steps if h is not None))
        lines += [
            f"{forecast.name:<{width}}"
            + "".join(
                f"{_cell('rmse', of['rmse']) + ' (' + _cell('coverage_90', of['coverage_90']) + ')':>14}"
                for of in forecast.horizon
            )
            for forecast in forecasts
        ]
    return "\n".join([head, "", *lines])


def _rows(values: NDArray[np.float64]) -> list[object]:
    """Turn an array (n, ...) into a list of n, None where there is NaN."""
    return [None if np.isnan(row).any() else row.tolist() for row in values]


def _known(uv_m: NDArray[np.float64], turn_unknown: bool, turn_rad: float = 0.0) -> NDArray[np.float64] | None:
    return np.append(uv_m, np.nan if turn_unknown else turn_rad) if np.isfinite(uv_m).all() else None


def _line(name: str, cells: Sequence[str], width: int) -> str:
    return f"{name:<{width}}" + "".join(f"{cell:>9}" for cell in cells)


def _cell(key: str, value: float | None) -> str:
    if value is None:
        return "-"
    if key == "n":
        return f"{value:d}"
    return f"{value * 100.0:.0f} %" if key == "coverage_90" else f"{value * 1e3:.2f}"
