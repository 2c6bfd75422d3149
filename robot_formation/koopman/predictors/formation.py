"""The project's own model of the leader-induced displacement: no single model wins, so several are combined."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robot_formation.koopman.predictors.models import Ewma, Insight, KalmanTrend, Matrix, Model, Vector, vector
from robot_formation.koopman.predictors.parameters import PredictorParameters


class Mixture:
    """Models weighted, for each axis, by exp(-S / 2) with S the discounted sum of their squared scaled errors."""

    def __init__(self, parameters: PredictorParameters) -> None:
        p = parameters.formation
        self._discount = p.discount
        self._scale = parameters.kalman_trend.noise_m
        self._models: dict[str, Model] = {"kalman_trend": KalmanTrend(parameters), "ewma": Ewma(parameters)}
        self._losses: Matrix = np.zeros((len(self._models), 2))
        self._begun = False

    def observe(self, x: Vector) -> None:
        if self._begun:
            errors = (self._forecasts() - x) / self._scale
            self._losses = self._discount * self._losses + errors**2
        for model in self._models.values():
            model.observe(x)
        self._begun = True

    def forecast(self) -> Vector:
        return np.asarray((self._weights() * self._forecasts()).sum(axis=0))

    def _forecasts(self) -> Matrix:
        return np.stack([model.forecast() for model in self._models.values()])

    def _weights(self) -> Matrix:
        weights = np.exp(-0.5 * (self._losses - self._losses.min(axis=0)))
        return np.asarray(weights / weights.sum(axis=0))

    def insight(self) -> Insight:
        return Insight()

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: Mapping[str, Any]) -> None:
        pass
