"""Calibrations as text for the terminal and as JSON. Distances in metres in JSON, in millimetres for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robot_formation.calibration.encoder_comparison import DistanceComparison, Spread
from robot_formation.calibration.motor_fit import AxisFit

Fits = Mapping[str, Mapping[str, AxisFit]]


def unit_of(axis: str) -> str:
    """Return the unit of an axis's travel."""
    return "rad" if axis == "turn" else "m"


def motors_text(fits: Fits) -> str:
    """Return a table of curves and residuals, then the residual of every rotation."""
    width = max(len(_polynomial(fit.curve)) for axes in fits.values() for fit in axes.values())
    lines = [
        "wheel rotation [rad] of the distance d [m] (turn: of the angle [rad])",
        f"robot       axis  {'curve':{width}}  residuals: RMS    largest    scatter of a drive",
    ]
    for robot, axes in fits.items():
        for axis, fit in axes.items():
            values = (fit.residual_rms, fit.residual_max, fit.scatter)
            rms, largest, scatter = (f"{value * 1e3:.2f} m{unit_of(axis)}" for value in values)
            lines.append(f"{robot:10}  {axis:4}  {_polynomial(fit.curve):{width}}{rms:>16}{largest:>11}{scatter:>22}")
    lines += ["", "measured minus curve, by rotation:"]
    for robot, axes in fits.items():
        for axis, fit in axes.items():
            rotations = " ".join(f"{point.rotation_rad:7.2f}" for point in fit.points)
            residuals = " ".join(f"{point.residual * 1e3:+7.2f}" for point in fit.points)
            lines += [f"{robot:10}  {axis:4}  {'rad':4} {rotations}", f"{'':18}m{unit_of(axis):3} {residuals}"]
    return "\n".join(lines)


def motors_json(fits: Fits) -> dict[str, object]:
    """Return the fits by robot and axis; travels in `unit`, wheel rotations in rad."""
    return {robot: {axis: _axis_json(fit) for axis, fit in axes.items()} for robot, axes in fits.items()}


def encoders_text(comparisons: Sequence[DistanceComparison]) -> str:
    """Return the table of the three instruments, mean and standard deviation per preset distance."""
    lines = [
        "      preset  motor encoders   sensing wheels        reference   sensing - reference",
        "axis      cm              cm               cm               cm                     %",
    ]
    for row in comparisons:
        cells = (_spread(value, 100.0, 3) for value in (row.motor_m, row.sensing_m, row.reference_m))
        motor, sensing, reference = cells
        difference = _spread(row.difference, 100.0, 2, "+")
        lines.append(
            f"{row.axis:4}  {row.preset_m * 100:6.1f}  {motor:>14}   {sensing:>14}   {reference:>14}{difference:>22}"
        )
    return "\n".join(lines)


def encoders_json(comparisons: Sequence[DistanceComparison]) -> list[dict[str, object]]:
    """Return one entry per axis and preset distance."""
    return [
        {
            "axis": row.axis,
            "preset_m": row.preset_m,
            "drives": row.drives,
            "motor_m": _spread_json(row.motor_m),
            "sensing_m": _spread_json(row.sensing_m),
            "reference_m": _spread_json(row.reference_m),
            "difference": _spread_json(row.difference),
        }
        for row in comparisons
    ]


def _axis_json(fit: AxisFit) -> dict[str, object]:
    return {
        "unit": unit_of(fit.axis),
        "curve": list(fit.curve),
        "degree": fit.degree,
        "residual_rms": fit.residual_rms,
        "residual_max": fit.residual_max,
        "scatter": fit.scatter,
        "lack_of_fit": {str(degree): deviate for degree, deviate in fit.lack_of_fit.items()},
        "points": [
            {
                "rotation_rad": point.rotation_rad,
                "drives": point.drives,
                "travel": point.travel,
                "scatter": point.scatter,
                "residual": point.residual,
            }
            for point in fit.points
        ],
    }


def _polynomial(curve: Sequence[float]) -> str:
    terms = [f"{curve[0]:.4f}"]
    for power, coefficient in enumerate(curve[1:], start=1):
        sign = "-" if coefficient < 0.0 else "+"
        terms.append(f"{sign} {abs(coefficient):.4f} d{'' if power == 1 else f'^{power}'}")
    return " ".join(terms)


def _spread(value: Spread, scale: float, digits: int, sign: str = "") -> str:
    return f"{value.mean * scale:{sign}.{digits}f} ± {value.std * scale:.{digits}f}"


def _spread_json(value: Spread) -> dict[str, float]:
    return {"mean": value.mean, "std": value.std}
