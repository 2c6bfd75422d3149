"""One hypothesis about the neighbour's pose, and what a look makes of it: an iterated extended Kalman update."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_formation.alignment.precise.marker_edges import Edge, EdgeParameters, View, hidden, sliver
from robot_formation.alignment.precise.marker_projection import SIZE, YAW, MarkerModel, Matrix, Vector, X, Y
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.picture import WIDTH

# All chosen.
_ITERATIONS, _CONVERGED = 6, 1e-5
"""Most iterations of an update, and the change of the state [m, rad, 1/m] below which it ends."""
_LARGEST_CHANGE_RAD = 0.3
"""Bound on an iteration's change of the heading: farther away the linearisation doesn't hold."""
_DIFFERENCE = 1e-4
"""Step of the central differences, m, rad or 1/m: an edge moves by about 0.1 px at most."""
_OFFSETS = _DIFFERENCE * np.concatenate([np.zeros((1, SIZE)), np.eye(SIZE), -np.eye(SIZE)])
"""From a state to all those at which a linearisation looks."""
_STRAY_SIGMAS = 1.5
"""Residual, in standard deviations, from which on an edge pulls with limited force; 1.345 is usual (Huber)."""
_WORST_RESIDUALS, _OUTLIER_SIGMAS = 9.0, 2.5
"""Squared residuals of a look's edges from which on the marker isn't seen whole; where they begin to grow less."""
_NIS_SIGMAS = 2.0
"""For the NIS, an edge's standard deviation counts so many times."""
_BORDER_PX = 8.0
"""Of a face that the picture cuts off, so much more must show before it is always reported."""
_LEAST_WIDTH_PX, _WIDTH_SIGMA_PX = 1.0, 2.0
"""A face that was reported must be so wide; standard deviation of that."""
_FARTHEST_M, _LARGEST_YAW_RAD = 2.0, 2.0
"""Bounds on place and heading of a neighbour that could be in view: from there a face is 8 px wide, and the first
guesses go to 92 degrees."""


@dataclass
class Hypothesis:
    """State (6,) and covariance (6, 6) as in `marker_projection`, -2 log likelihood of all looks, and by which of the
    step models (number) it followed the neighbour's last step.
    """

    state: Vector
    covariance: Matrix
    cost: float = 0.0
    model: int = 0

    @property
    def sane(self) -> bool:
        """Whether it is about a neighbour that could be in view."""
        x, y, yaw = (float(self.state[index]) for index in (X, Y, YAW))
        finite = math.isfinite(self.cost) and bool(np.isfinite(self.state).all())
        return finite and math.hypot(x, y) < _FARTHEST_M and abs(yaw) < _LARGEST_YAW_RAD


def _plus_diagonal(matrix: Matrix, diagonal: Vector) -> Matrix:
    """Add to the diagonal of a square matrix, in place: that takes half as long as adding `np.diag(diagonal)`."""
    matrix.flat[:: len(matrix) + 1] += diagonal
    return matrix


class LookUpdate:
    """Brings hypotheses and looks together."""

    def __init__(self, model: MarkerModel, edges: EdgeParameters) -> None:
        self._model = model
        self._edges = edges

    def update(self, hypothesis: Hypothesis, seen: View) -> None:
        """Update a hypothesis in place; the cost is that of the posterior's residuals and of the way to it."""
        edges = [*self._trusted(hypothesis.state, seen), *self._exceeded(hypothesis.state, seen)]
        if not edges:
            return
        measured = np.array([edge.position_px for edge in edges])
        sigmas = np.array([edge.sigma_px for edge in edges])
        squares, limits = sigmas**2, _STRAY_SIGMAS * sigmas
        prior, covariance = hypothesis.state, hypothesis.covariance
        state = prior
        for number in range(_ITERATIONS):
            h, predicted = self._linearise(state, edges)
            # Huber's weights: an edge that contradicts the others, as of a broken block, pulls with limited force.
            strays = np.maximum(1.0, np.abs(measured - predicted) / limits) if number else 1.0
            variance = squares * strays
            shared = h @ covariance
            scatter = _plus_diagonal(shared @ h.T, variance)
            gain = np.linalg.solve(scatter, shared).T
            change = prior + gain @ (measured - predicted - h @ (prior - state)) - state
            change[YAW] = max(-_LARGEST_CHANGE_RAD, min(_LARGEST_CHANGE_RAD, change[YAW]))
            state = state + change
            if float(np.abs(change).max()) < _CONVERGED:
                break
        h, predicted = self._linearise(state, edges)
        kept = np.eye(SIZE) - gain @ h
        hypothesis.covariance = kept @ covariance @ kept.T + (gain * variance) @ gain.T
        hypothesis.state = state
        residual, way = measured - predicted, state - prior
        hypothesis.cost += float(residual @ (residual / variance) + way @ np.linalg.solve(covariance, way))
        hypothesis.cost += float(np.linalg.slogdet(scatter)[1])
        hypothesis.cost += self._contradiction(state, seen)

    def fits(self, guess: Hypothesis, seen: View) -> bool:
        """Whether a look fits a pose near a guess, which is updated in place."""
        self.update(guess, seen)
        return guess.sane and self._residuals(guess.state, seen) < _WORST_RESIDUALS

    def nis(self, hypotheses: Sequence[Hypothesis], seen: View) -> float:
        """Normalised innovation squared (NIS) of a look by the best hypothesis, per edge."""
        if not seen.edges:
            return 0.0
        costs = []
        for hypothesis in hypotheses:
            h, predicted = self._linearise(hypothesis.state, seen.edges)
            innovation = np.array([edge.position_px for edge in seen.edges]) - predicted
            variance = np.array([_NIS_SIGMAS**2 * edge.sigma_px**2 for edge in seen.edges])
            scatter = _plus_diagonal(h @ hypothesis.covariance @ h.T, variance)
            costs.append(float(innovation @ np.linalg.solve(scatter, innovation)) / len(seen.edges))
        return min(costs)

    def _residuals(self, state: Vector, seen: View) -> float:
        edges = [*self._trusted(state, seen), *self._exceeded(state, seen)]
        if not edges:
            return 0.0
        predicted = self._linearise(state, edges)[1]
        ratios = (np.array([edge.position_px for edge in edges]) - predicted) / [edge.sigma_px for edge in edges]
        strays = np.maximum(1.0, np.abs(ratios) / _OUTLIER_SIGMAS)
        return float(np.sum(ratios**2 / strays)) + self._contradiction(state, seen)

    def _linearise(self, state: Vector, edges: Sequence[Edge]) -> tuple[Matrix, Vector]:
        found = self._model.edges(state + _OFFSETS, edges)
        return ((found[1 : SIZE + 1] - found[SIZE + 1 :]) / (2.0 * _DIFFERENCE)).T, found[0]

    def _trusted(self, state: Vector, seen: View) -> list[Edge]:
        """List the edges; a Front face that is not reported may shift the Target block's right one."""
        if Face.FRONT in seen.faces or (front_px := self._model.widths(state)[Face.FRONT]) <= 0.0:
            return list(seen.edges)
        return [
            sliver(edge, front_px, self._edges) if (edge.face, edge.side) == (Face.TARGET, "right") else edge
            for edge in seen.edges
        ]

    def _exceeded(self, state: Vector, seen: View) -> list[Edge]:
        """List the bounds on faces that were not reported which a state breaks."""
        columns = self._model.pixels(state[None])[0, :, 0]
        cut = columns.min() < 0.0 or columns.max() > WIDTH
        shown, spare = self._model.shown(state, (0.0, WIDTH)), _BORDER_PX if cut else 0.0
        return [edge for edge in hidden(seen, self._edges) if shown[edge.face] > edge.position_px + spare]

    def _contradiction(self, state: Vector, seen: View) -> float:
        """Charge faces that were reported and should not have been, or the other way round."""
        widths = self._model.widths(state)
        cost = sum(max(0.0, _LEAST_WIDTH_PX - widths[face]) ** 2 / _WIDTH_SIGMA_PX**2 for face in seen.faces)
        for edge in self._exceeded(state, seen):
            cost += ((widths[edge.face] - edge.position_px) / edge.sigma_px) ** 2
        return cost
