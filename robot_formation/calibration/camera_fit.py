"""From samples to the curves of the paper's fine-tuning: pan (column against v) and side length against u.

Both are views of one face by one camera, so they are fitted together. With the follower's place (u, v), parallel to
its neighbour, and q = distance / (u - u_formation + distance), which is 1 in formation:

    column = target_x + slope (lead - q (v + lead))
    side   = edge slope q - bias

`lead` is where the lens sits ahead of the place from which the column doesn't depend on u: 0 for a camera in the
robot's middle that looks exactly sideways.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from robot_formation.alignment.observation import MARGIN_PX, FaceBox, bounding_boxes
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.drive.curves import CalibrationError
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.picture import WIDTH

Floats = NDArray[np.float64]

WINDOW_M = 0.03
"""Half of the fine-tuning window along v: half a face of the marker, and the paper's (-3, 3) cm."""
FITTED_M = 0.05
"""Farthest v that the curves are fitted to. Beyond, a sliver of the next face, too narrow to be reported, widens the
Target block."""
COMPARED_M = (0.3, 0.4)
"""Distances u between which columns are compared. The paper's figure has three curves and doesn't say of which u; the
three of its grid about the formation distance give its 7 px."""
NAMES = ("target_x_px", "slope_px_per_m", "distance_m", "lead_m", "side_bias_px")
_SAME_M = 1e-9
_CONVERGED = 1e-12


@dataclass(frozen=True)
class FaceView:
    """The whole Target face from a follower that is parallel to its neighbour.

    Attributes:
        u_m: as in `CameraSample`.
        v_m: as in `CameraSample`.
        box: bounding box of the Target blocks, px.
        alone: no other face was reported.
    """

    u_m: float
    v_m: float
    box: FaceBox
    alone: bool


@dataclass(frozen=True)
class CameraFit:
    """The fitted curves.

    Attributes:
        target_x_px: column of the Target block in formation.
        slope_px_per_m: how much the column falls per metre ahead (rises per metre behind), at the formation distance.
        distance_m: from lens to face in formation.
        lead_m: see the module's text.
        side_bias_px: what the detector reports less than the true side length.
        edge_m: edge of the marker's faces.
        errors: standard errors by name.
        views: how many views were fitted.
        column_rms_px: RMS of the columns' residuals.
        side_rms_px: RMS of the side lengths' residuals.
    """

    target_x_px: float
    slope_px_per_m: float
    distance_m: float
    lead_m: float
    side_bias_px: float
    edge_m: float
    errors: Mapping[str, float]
    views: int
    column_rms_px: float
    side_rms_px: float

    @property
    def side_px_m(self) -> float:
        """True side length times distance, px m."""
        return self.edge_m * self.slope_px_per_m * self.distance_m

    def column(self, u_m: Floats | float, v_m: Floats | float) -> Floats:
        """Return the column of the Target block at places, px."""
        return _model(self._vector(), np.asarray(u_m, float), np.asarray(v_m, float), self.edge_m)[0]

    def side(self, u_m: Floats | float) -> Floats:
        """Return the side length that the camera reports at distances u, px."""
        u = np.asarray(u_m, float)
        return _model(self._vector(), u, np.zeros_like(u), self.edge_m)[1]

    def alignment(self) -> dict[str, float]:
        """Give the fine-tuner's parameters `alignment.*` that the curves determine."""
        return {
            "target_x_px": self.target_x_px,
            "slope_px_per_m": self.slope_px_per_m,
            "side_px_m": self.side_px_m,
            "side_bias_px": self.side_bias_px,
            "distance_m": self.distance_m,
        }

    def window_px(self) -> tuple[float, float]:
        """Columns between which the Target block lies while v is inside the fine-tuning window, in formation."""
        half = self.slope_px_per_m * WINDOW_M
        return self.target_x_px - half, self.target_x_px + half

    def _vector(self) -> Floats:
        return np.array([getattr(self, name) for name in NAMES])


def face_views(samples: Iterable[CameraSample]) -> list[FaceView]:
    """List the views of a whole Target face by a follower that is parallel to its neighbour, by u, then v."""
    views = []
    for sample in samples:
        boxes = bounding_boxes(sample.blocks)
        box = boxes.get(Face.TARGET)
        if sample.clockwise_deg != 0.0 or box is None:
            continue
        if box.left > MARGIN_PX and box.right < WIDTH - 1.0 - MARGIN_PX:
            views.append(FaceView(sample.u_m, sample.v_m, box, len(boxes) == 1))
    return sorted(views, key=lambda view: (view.u_m, view.v_m))


def fit_camera(views: Iterable[FaceView], edge_m: float) -> CameraFit:
    """Fit the curves by least squares to the views of the Target face alone, up to 5 cm ahead and behind.

    Args:
        views: of the whole Target face.
        edge_m: edge of the marker's faces, from a ruler.

    Raises:
        CalibrationError: if the views don't determine the curves.
    """
    used = [view for view in views if view.alone and abs(view.v_m) <= FITTED_M + _SAME_M]
    u, v = (np.array([getattr(view, name) for view in used]) for name in ("u_m", "v_m"))
    if len(np.unique(u)) < 3 or len(np.unique(v)) < 3:
        raise CalibrationError(
            f"{len(used)} views of the Target face alone, parallel and within {FITTED_M * 100:g} cm along v, are too "
            "few for the curves; is the marker in view and its colour taught? Or choose a smaller --step"
        )
    columns = np.array([view.box.x for view in used])
    sides = np.array([view.box.side for view in used])
    solved = least_squares(
        partial(_residuals, u=u, v=v, columns=columns, sides=sides, edge_m=edge_m),
        _start(u, v, columns, sides, edge_m),
        partial(_jacobian, u=u, v=v, edge_m=edge_m),
        method="lm",
        x_scale="jac",
        ftol=_CONVERGED,
        xtol=_CONVERGED,
        gtol=_CONVERGED,
    )
    found, residuals = solved.x, solved.fun
    jacobian = _jacobian(found, u, v, edge_m)
    if found[2] <= 0.0 or np.linalg.matrix_rank(jacobian) < len(NAMES):
        raise CalibrationError("the views of the Target face lie on no pan and side-length curves; look at the table")
    freedom = max(2 * len(used) - len(NAMES), 1)
    variance = float(residuals @ residuals) / freedom
    errors = np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    values = {name: float(value) for name, value in zip(NAMES, found, strict=True)}
    return CameraFit(
        **values,
        edge_m=edge_m,
        errors={name: float(error) for name, error in zip(NAMES, errors, strict=True)},
        views=len(used),
        column_rms_px=_rms(residuals[: len(used)]),
        side_rms_px=_rms(residuals[len(used) :]),
    )


def pan_distances(views: Iterable[FaceView]) -> list[float]:
    """List the distances u at which the face was seen from at least three places along v."""
    places: dict[float, int] = {}
    for view in views:
        places[view.u_m] = places.get(view.u_m, 0) + 1
    return sorted(u for u, count in places.items() if count >= 3)


def alone_range(views: Iterable[FaceView], u_m: float) -> tuple[float, float]:
    """Tell how far behind and ahead, v [m], a follower at a distance u sees the Target face alone throughout."""
    ordered = sorted((view.v_m, view.alone) for view in views if view.u_m == u_m)
    ends = []
    for sign in (-1.0, 1.0):
        side = sorted((sign * v, alone) for v, alone in ordered if sign * v >= 0.0)
        seen = itertools.takewhile(lambda place: place[1], side)
        ends.append(sign * max((v for v, _ in seen), default=0.0) + 0.0)
    return ends[0], ends[1]


def compared_distances(distances_m: Sequence[float]) -> list[float]:
    """Choose the distances whose columns are compared: those of 30 to 40 cm, or all if these are fewer than two."""
    low, high = COMPARED_M
    chosen = [u for u in distances_m if low - _SAME_M <= u <= high + _SAME_M]
    return chosen if len(chosen) > 1 else list(distances_m)


def difference_px(views: Iterable[FaceView], distances_m: Sequence[float]) -> dict[float, float]:
    """Largest difference of the column between distances u, by v [m]; only where all of them show the face."""
    columns: dict[float, dict[float, float]] = {}
    for view in views:
        if any(abs(view.u_m - u) < _SAME_M for u in distances_m):
            columns.setdefault(view.v_m, {})[view.u_m] = view.box.x
    return {
        v: max(found.values()) - min(found.values())
        for v, found in sorted(columns.items())
        if len(found) == len(distances_m)
    }


def _model(vector: Floats, u: Floats, v: Floats, edge_m: float) -> tuple[Floats, Floats]:
    target_x, slope, distance, lead, bias = vector
    q = distance / (u - FORMATION_DISTANCE_M + distance)
    return target_x + slope * (lead - q * (v + lead)), edge_m * slope * q - bias


def _start(u: Floats, v: Floats, columns: Floats, sides: Floats, edge_m: float) -> Floats:
    """Solve the curves for a guessed distance: they are linear in all else."""
    distance = FORMATION_DISTANCE_M
    q = distance / u
    one, zero = np.ones_like(u), np.zeros_like(u)
    upper = np.stack([one, -q * v, 1.0 - q, zero], axis=1)
    lower = np.stack([zero, edge_m * q, zero, -one], axis=1)
    both = np.concatenate([columns, sides])
    target_x, slope, product, bias = np.linalg.lstsq(np.concatenate([upper, lower]), both, rcond=None)[0]
    return np.array([target_x, slope, distance, product / slope if slope else 0.0, bias])


def _residuals(vector: Floats, u: Floats, v: Floats, columns: Floats, sides: Floats, edge_m: float) -> Floats:
    """Curves minus columns and side lengths (2n,)."""
    column, side = _model(vector, u, v, edge_m)
    return np.concatenate([column - columns, side - sides])


def _jacobian(vector: Floats, u: Floats, v: Floats, edge_m: float) -> Floats:
    """Derivatives (2n, 5) of the residuals."""
    _, slope, distance, lead, _ = vector
    depth = u - FORMATION_DISTANCE_M + distance
    q, dq = distance / depth, (u - FORMATION_DISTANCE_M) / depth**2
    one, zero = np.ones_like(u), np.zeros_like(u)
    upper = [one, lead - q * (v + lead), -slope * (v + lead) * dq, slope * (1.0 - q), zero]
    lower = [zero, edge_m * q, edge_m * slope * dq, zero, -one]
    return np.concatenate([np.stack(upper, axis=1), np.stack(lower, axis=1)])


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
