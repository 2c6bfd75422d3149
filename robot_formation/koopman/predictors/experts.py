"""Experts of the project's own predictor: each says what residual is left and how the leader will move on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.dmd import Edmd
from robot_formation.koopman.predictors.filter_bank import BankModel, FilterBank, weighted
from robot_formation.koopman.predictors.horizon import MOST_STEPS
from robot_formation.koopman.predictors.models import Matrix, Vector
from robot_formation.koopman.predictors.parameters import EdmdParameters


class Expert(Protocol):
    """A source of forecasts of (u, v, turn); NaN for axes of which it knows nothing."""

    def observe(self, total: Vector, residual: Vector, camera: Vector, unsure: Vector | None = None) -> None:
        """See `FilterBank.observe`."""

    def shift(self, change: Vector) -> None:
        """Add a change (3,) to the residual."""

    @property
    def residual(self) -> Vector:
        """Estimated residual (3,)."""

    def ahead(self, steps: int) -> Matrix:
        """Leader-induced displacements to come, (steps, 3)."""

    def state(self) -> JsonObject:
        """Return all that it has learned."""

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""


class BankExpert:
    """A bank of filters, weighted by likelihood: for each axis by itself, or for u and v together."""

    def __init__(self, model: BankModel, discount: float) -> None:
        self._bank = FilterBank(model, discount, MOST_STEPS)
        first = model.axes[:, 0]
        self._together = model.axes.shape[1] > 1
        # Axes, and the filters that speak for them.
        self._groups: list[tuple[list[int], NDArray[np.int64]]] = (
            [([0, 1], np.arange(len(first)))]
            if self._together
            else [([axis], np.flatnonzero(first == axis)) for axis in sorted(set(first.tolist()))]
        )

        self._weigh()

    def _weigh(self) -> None:
        losses = self._bank.losses
        self._weights = [weighted(losses[filters]) for _, filters in self._groups]

    def observe(self, total: Vector, residual: Vector, camera: Vector, unsure: Vector | None = None) -> None:
        """See `Expert`."""
        self._bank.observe(total, residual, camera, unsure)
        self._weigh()

    def shift(self, change: Vector) -> None:
        """See `Expert`."""
        self._bank.shift(change)

    def weights(self) -> dict[int, Vector]:
        """Weights of the filters that speak for each axis."""
        return {axis: weights for (axes, _), weights in zip(self._groups, self._weights, strict=True) for axis in axes}

    @property
    def residual(self) -> Vector:
        """See `Expert`."""
        found, means = np.full(3, np.nan), self._bank.means
        for (axes, filters), weights in zip(self._groups, self._weights, strict=True):
            found[axes] = weights @ means[filters, : len(axes)]
        return found

    def ahead(self, steps: int) -> Matrix:
        """See `Expert`."""
        found, ahead = np.full((steps, 3), np.nan), self._bank.ahead(steps)
        for (axes, filters), weights in zip(self._groups, self._weights, strict=True):
            found[:, axes] = (weights @ ahead[filters].reshape(len(filters), -1)).reshape(steps, len(axes))
        return found

    def state(self) -> JsonObject:
        """See `Expert`."""
        return self._bank.state()

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Expert`."""
        self._bank.restore(state)
        self._weigh()


class DmdExpert:
    """Online DMD of (u, v) with a dictionary, learned from the displacements that another expert has filtered."""

    def __init__(self, parameters: EdmdParameters, filtered: Expert) -> None:
        self.model = Edmd(parameters)
        self._filtered = filtered
        self._begun = False

    def observe(self, total: Vector, residual: Vector, camera: Vector, unsure: Vector | None = None) -> None:
        """See `Expert`; after the expert that filters."""
        if np.isnan(residual[:2]).any():
            self.model.advance()
        else:
            self.model.observe(self._filtered.ahead(1)[0, :2])
            self._begun = True

    def shift(self, change: Vector) -> None:
        """See `Expert`; the other one's is shifted."""

    @property
    def residual(self) -> Vector:
        """See `Expert`."""
        return self._filtered.residual

    def ahead(self, steps: int) -> Matrix:
        """See `Expert`."""
        found = np.full((steps, 3), np.nan)
        found[:, :2] = self.model.ahead(steps) if self._begun else self._filtered.ahead(steps)[:, :2]
        return found

    def state(self) -> JsonObject:
        """See `Expert`."""
        return {"model": self.model.state(), "begun": self._begun}

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Expert`."""
        self.model.restore(state["model"])
        self._begun = bool(state["begun"])
