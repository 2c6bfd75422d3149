"""The camera's calibration as text for the terminal and as JSON. Metres in JSON, centimetres for people; pixels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from robot_formation.calibration.camera_edge_bias import EdgeBias
from robot_formation.calibration.camera_fit import (
    WINDOW_M,
    CameraFit,
    FaceView,
    alone_range,
    compared_distances,
    difference_px,
    pan_distances,
)
from robot_formation.calibration.camera_samples import CameraSample, Overlay, overlay
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M

_SYMBOLS = {
    "unattainable": "#",
    "nothing": ".",
    "front": "F",
    "target": "T",
    "rear": "R",
    "front or target": "f",
    "target or rear": "r",
}
_LEGEND = (
    "F Front, T Target, R Rear area, f and r: those or Target alone, by the angle, # unattainable, . never in view"
)
_DIFFERENT = "?"


@dataclass(frozen=True)
class VisionResult:
    """All that a calibration has found."""

    samples: Sequence[CameraSample]
    views: Sequence[FaceView]
    fit: CameraFit
    edges: Mapping[str, EdgeBias]

    def grid(self) -> list[Overlay]:
        """List the positions of the grid: those that were looked at under the most angles."""
        places = overlay(self.samples)
        most = max(place.angles for place in places)
        return [place for place in places if place.angles == most]

    def distances(self) -> tuple[list[float], list[float]]:
        """Return the distances u of the pan curves, and those of them that are compared."""
        found = pan_distances(self.views)
        return found, compared_distances(found)

    def alone(self) -> dict[float, tuple[float, float]]:
        """Return the range of v in which the Target block is seen alone, by distance u, m."""
        return {u: alone_range(self.views, u) for u in pan_distances(self.views)}

    def measured_difference_px(self, distances_m: Sequence[float]) -> float | None:
        """Largest measured difference of the column inside the window; None if nowhere all distances were seen."""
        found = difference_px(self.views, distances_m)
        return max((px for v, px in found.items() if abs(v) <= WINDOW_M + 1e-9), default=None)

    def fitted_difference_px(self, distances_m: Sequence[float]) -> float:
        """Return the same by the fitted curves, which know no quantisation."""
        ends = [[float(self.fit.column(u, v)) for u in distances_m] for v in (-WINDOW_M, WINDOW_M)]
        return max(max(columns) - min(columns) for columns in ends)


def vision_text(result: VisionResult) -> str:
    """Return the map of the areas and the curves' figures."""
    fit = result.fit
    looked = [s for s in result.samples if s.attainable]
    distances, compared = result.distances()
    left, right = fit.window_px()
    side = float(fit.side(FORMATION_DISTANCE_M))
    per_cm = float(fit.side(FORMATION_DISTANCE_M - 0.005) - fit.side(FORMATION_DISTANCE_M + 0.005))
    lines = [
        f"{len(result.samples)} poses, {len(looked)} attainable, {sum(bool(s.blocks) for s in looked)} with blocks",
        "",
        *_map(result.grid()),
        "",
        "Target block alone, follower parallel to its neighbour: v [cm] from the places looked at",
        *(f"  u {u * 100:g} cm: {low * 100:+g} to {high * 100:+g}" for u, (low, high) in result.alone().items()),
        "",
        "pan: column of the Target block [px] = target_x - slope v in formation",
        f"  target_x {fit.target_x_px:.2f} ± {fit.errors['target_x_px']:.2f} px, "
        f"slope {fit.slope_px_per_m / 100:.3f} ± {fit.errors['slope_px_per_m'] / 100:.3f} px/cm",
        f"  fine-tuning window, v of -{WINDOW_M * 100:g} to {WINDOW_M * 100:g} cm: "
        f"columns {left:.0f} to {right:.0f} px",
    ]
    for chosen in (compared, distances) if compared != distances else (compared,):
        measured = result.measured_difference_px(chosen)
        said = "not measured" if measured is None else f"{measured:.0f} px"
        lines.append(
            f"  largest difference inside it, u of {chosen[0] * 100:g} to {chosen[-1] * 100:g} cm: {said} "
            f"(fitted curves: {result.fitted_difference_px(chosen):.1f} px)"
        )
    lines += [
        "",
        "side length: longer side [px] = side_px_m / distance - side_bias, distance = u - 32 cm + distance_m",
        f"  side_px_m {fit.side_px_m:.3f} px m, "
        f"side_bias {fit.side_bias_px:.2f} ± {fit.errors['side_bias_px']:.2f} px, "
        f"distance_m {fit.distance_m:.4f} ± {fit.errors['distance_m']:.4f} m",
        f"  in formation {side:.1f} px, changing by {per_cm:.2f} px per cm",
        "",
        f"fitted to {fit.views} views; residuals {fit.column_rms_px:.2f} px RMS of columns, "
        f"{fit.side_rms_px:.2f} px of side lengths",
    ]
    lines += ["", "edges of whole faces, reported minus true [px]: mean, scatter of one look, looks"]
    for name, bias in result.edges.items():
        said = name.replace("_px", "").replace("_", " ")
        lines.append(f"  {said:18} {bias.mean_px:+6.2f} {bias.scatter_px:6.2f} {bias.views:5d}")
    return "\n".join(lines)


def vision_json(result: VisionResult) -> dict[str, object]:
    """Return poses, areas by position, curves, and the fine-tuner's values with their standard errors."""
    fit = result.fit
    distances, compared = result.distances()
    grid = result.grid()
    return {
        "looks": {
            "poses": len(result.samples),
            "attainable": sum(s.attainable for s in result.samples),
            "with_blocks": sum(bool(s.blocks) for s in result.samples),
        },
        "areas": dict(sorted(Counter(place.area for place in grid).items())),
        "positions": [
            {"u_m": p.u_m, "v_m": p.v_m, "area": p.area, "angles": p.angles, "attainable": p.attainable, "seen": p.seen}
            for p in grid
        ],
        "target_alone": [{"u_m": u, "v_m": list(ends)} for u, ends in result.alone().items()],
        "pan": {
            "window_m": [-WINDOW_M, WINDOW_M],
            "window_px": list(fit.window_px()),
            "u_m": distances,
            "difference": [
                {
                    "u_m": chosen,
                    "largest_px": result.measured_difference_px(chosen),
                    "fitted_px": result.fitted_difference_px(chosen),
                }
                for chosen in ((compared, distances) if compared != distances else (compared,))
            ],
            "curves": [
                {"u_m": u, "points": [{"v_m": w.v_m, "column_px": w.box.x} for w in result.views if w.u_m == u]}
                for u in distances
            ],
        },
        "side": {
            "formation_px": float(fit.side(FORMATION_DISTANCE_M)),
            "points": [
                {
                    "u_m": view.u_m,
                    "width_px": view.box.width,
                    "height_px": view.box.height,
                    "curve_px": float(fit.side(view.u_m)),
                }
                for view in result.views
                if view.v_m == 0.0
            ],
        },
        "alignment": fit.alignment(),
        "lead_m": fit.lead_m,
        "standard_errors": dict(fit.errors),
        "edges": {name: asdict(bias) for name, bias in result.edges.items()},
        "residuals": {"views": fit.views, "column_rms_px": fit.column_rms_px, "side_rms_px": fit.side_rms_px},
    }


def _map(places: Sequence[Overlay]) -> list[str]:
    axis = sorted({place.u_m for place in places})
    symbols = {(place.u_m, place.v_m): _SYMBOLS.get(place.area, _DIFFERENT) for place in places}
    lines = ["areas, all relative angles overlaid; u to the right, v ahead of the neighbour [cm]"]
    for v in reversed(axis):
        lines.append(f"{v * 100:+5.0f}  " + "  ".join(symbols[u, v] for u in axis))
    lines.append("       " + "  ".join("|" if round(u * 100) % 15 == 0 else " " for u in axis).rstrip())
    lines.append("     " + _ticks(axis))
    lines.append(_LEGEND)
    return lines


def _ticks(axis: Sequence[float]) -> str:
    text = ""
    for number, u in enumerate(axis):
        if round(u * 100) % 15 == 0:
            text = text.ljust(3 * number) + f"{u * 100:+4.0f}"
    return text
