"""The project's own model of the leader-induced displacement w.

No single model wins. Where slip is systematic, a Koopman operator with a constant observable finds the law; where
noise dominates, the filtered displacement of the last timestep is the best that can be said. Both forecast, and for
each axis their forecasts are weighted by how well each has done lately (discounted exponential weights; Vovk 1990).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.dmd import Edmd
from robot_formation.koopman.predictors.models import Diagnostics, Matrix, Model, Previous, Vector, array
from robot_formation.koopman.predictors.parameters import PredictorParameters


class Mixture:
    """Persistence of the filtered w and online EDMD with a prior, combined by their past errors."""

    def __init__(self, parameters: PredictorParameters) -> None:
        p = self._p = parameters.formation
        self._koopman = Edmd(p.edmd)
        self._models: dict[str, Model] = {"persistence": Previous(parameters), "koopman": self._koopman}
        self._scale = np.array([p.scale_u_m, p.scale_v_m])
        # Half squared errors in units of the scale: persistence is believed first.
        self._losses: Matrix = np.array([[0.0, 0.0], [p.initial_loss, p.initial_loss]])
        self._begun = False

    def judge(self, w: Vector) -> None:
        """Process w of a timestep as the camera saw it, before it is filtered, to tell how good the forecasts were."""
        if self._begun:
            self._losses = self._p.discount * self._losses + 0.5 * ((self._forecasts() - w) / self._scale) ** 2

    def observe(self, x: Vector) -> None:
        """See `Model`."""
        for model in self._models.values():
            model.observe(x)
        self._begun = True

    def forecast(self) -> Vector:
        """See `Model`."""
        return np.asarray((self._weights() * self._forecasts()).sum(axis=0))

    def diagnostics(self) -> Diagnostics:
        """See `Model`: that of the Koopman model, and how much it counts."""
        inner = self._koopman.diagnostics()
        notes = dict(inner.notes or {})
        notes["weight of koopman"] = np.array2string(self._weights()[1], precision=3, separator=", ")
        return Diagnostics(inner.k, inner.condition_number, inner.innovation, notes)

    def state(self) -> JsonObject:
        """See `Model`."""
        models = {name: model.state() for name, model in self._models.items()}
        return {"models": models, "losses": self._losses.tolist(), "begun": self._begun}

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Model`."""
        for name, model in self._models.items():
            model.restore(state["models"][name])
        self._losses = array(state["losses"], 2, 2)
        self._begun = bool(state["begun"])

    def _forecasts(self) -> Matrix:
        return np.stack([model.forecast() for model in self._models.values()])

    def _weights(self) -> Matrix:
        weights = np.exp(self._losses.min(axis=0) - self._losses)
        return np.asarray(weights / weights.sum(axis=0))
