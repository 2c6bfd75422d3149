"""The project's own predictor: experts of different kinds, combined for each axis by how well each has done lately.

No single model wins. On straight tracks noise dominates, and the filtered displacement of the last timestep is the best
that can be said; on periodic paths Koopman oscillators know the future; on what is neither, trends and delay-embedded
DMD do. Residual and actuation bias are closed as in `closing`, but each expert estimates the residual by itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.aggregation import Aggregation, ExponentialWeights, MlPoly
from robot_formation.koopman.predictors.closing import ActuationBias
from robot_formation.koopman.predictors.experts import BankExpert, DmdExpert, Expert
from robot_formation.koopman.predictors.horizon import MOST_STEPS
from robot_formation.koopman.predictors.models import Diagnostics, Matrix, Vector, vector
from robot_formation.koopman.predictors.oscillators import (
    PriorKnowledge,
    joined,
    oscillators,
    periods_of,
    trends,
    turning,
)
from robot_formation.koopman.predictors.parameters import EdmdParameters, PredictorParameters
from robot_formation.koopman.predictors.spatial import rotated

AXES = ("u", "v", "turn")
# Displacements are all there is where no residual was ever seen: so finely are they taken as they are.
_EXACT = np.array([1e-4, 1e-4, 1e-3]) ** 2
# How much each expert is believed at first, one by one; persistence gets its weight from 'initial_loss'.
_PRIORS = {
    "persistence": 1.0,
    "trends": 1.0,
    "oscillators": 2.0,
    "overtones": 1.0,
    "rotation": 2.0,
    "dmd": 0.5,
    "delays 3": 1.0,
    "delays 6": 1.0,
}


class MixedExperts:
    """Experts of residual and leader-induced displacement, aggregated per axis; and the actuation bias."""

    def __init__(self, parameters: PredictorParameters, chosen: Sequence[str] = tuple(_PRIORS)) -> None:
        p = parameters.formation
        closing = self._closing = parameters.closing
        known = PriorKnowledge(closing)
        self._camera = known.camera
        self._bounds = np.array([parameters.max_u_m, parameters.max_v_m, parameters.max_turn_rad])
        self._periods = periods_of(p.oscillators)
        self._parameters, self._chosen = parameters, chosen
        self.experts = _experts(parameters, known, chosen)
        first = {**_PRIORS, "persistence": math.exp(p.initial_loss)}
        prior = np.array([first[name] for name in chosen])
        self._coupling = p.coupling
        self._aggregations: list[Aggregation] = []
        self._speak: list[NDArray[np.int64]] = []
        self._residuals: Matrix = np.empty(0)
        self._steps: NDArray[np.float64] = np.empty(0)
        self._estimate()
        for axis, scale in enumerate((p.scale_u_m, p.scale_v_m, p.scale_v_m * closing.rad_per_m)):
            speak = np.flatnonzero(np.isfinite(self._residuals[:, axis] + self._steps[:, 0, axis]))
            self._speak.append(speak)
            shares = prior[speak] / prior[speak].sum()
            self._aggregations.append(
                MlPoly(shares, scale) if p.aggregation == "ml_poly" else ExponentialWeights(shares, scale, p.discount)
            )
        self._bias = ActuationBias(closing)
        self._seen = np.zeros(3, dtype=bool)
        self._last_turn = 0.0
        self._begun = False

    def __repr__(self) -> str:
        return f"MixedExperts({', '.join(self._chosen)})"

    def observe(
        self,
        displacement: Vector,
        residual: Vector | None,
        commanded: Vector | None,
        caught_up_rad: float = 0.0,
    ) -> None:
        """Update with a timestep's total (3,), its residual (3,) and its command (3,), where they are known.

        `caught_up_rad`: see `Predictor.observe`.
        """
        if commanded is not None:
            self._bias.observe(displacement, commanded)
        if not self._begun and residual is None:
            self._begin_with(displacement)
        self._begun = True
        seen = np.full(3, np.nan) if residual is None else residual
        self._seen |= np.isfinite(seen)
        turn = float(displacement[2])
        blind = residual is None and bool(self._seen[:2].any())
        if not blind:
            self._last_turn = turn if not self._seen[2] else 0.0
        before = float(self.residual[2])
        if before:  # w is told in the frame of the place that the robot should have had
            w = self._mixed(self._steps[:, 0])[:2]
            self._shift(rotated(w, before) - w)
        seen = np.append(rotated(seen[:2], turn), seen[2])
        if not blind:
            seen[~self._seen] = 0.0
            self._judge(displacement + seen)
        camera = np.where(self._seen, self._camera, _EXACT)
        unsure = np.array([0.0, 0.0, caught_up_rad**2]) if caught_up_rad else None
        for expert in self.experts.values():
            expert.observe(displacement, seen, camera, unsure)
        self._estimate()
        if turn:  # on from the frame at the timestep's start to that at its end
            uv = self.residual[:2]
            self._shift(rotated(uv, -turn) - uv)

    def _begin_with(self, displacement: Vector) -> None:
        """Forget what was known beforehand of the leader's step: this log has no residuals, and may be of anything."""
        known = PriorKnowledge(self._closing)
        known.step, known.step_sigma = displacement, np.sqrt(_EXACT)
        self.experts = _experts(self._parameters, known, self._chosen)
        self._estimate()

    def _judge(self, ideal: Vector) -> None:
        """Weigh the experts by the ideal move (3,) that came; NaN where the turn was not seen."""
        for axis, (aggregation, speak) in enumerate(zip(self._aggregations, self._speak, strict=True)):
            if np.isfinite(ideal[axis]):
                forecasts = self._residuals[speak, axis] + self._steps[speak, 0, axis]
                aggregation.observe(forecasts, float(ideal[axis]))
        u, v = self._aggregations[:2]
        if self._coupling and isinstance(u, ExponentialWeights) and isinstance(v, ExponentialWeights):
            of_u, of_v = u.newest.copy(), v.newest.copy()
            u.add(self._coupling * of_v)
            v.add(self._coupling * of_u)

    def _shift(self, change_uv: Vector) -> None:
        change = np.append(change_uv, 0.0)
        self._residuals = self._residuals + change
        for expert in self.experts.values():
            expert.shift(change)

    def _estimate(self) -> None:
        """Ask every expert; NaN stands for axes of which it knows nothing."""
        experts = self.experts.values()
        self._residuals = np.stack([expert.residual for expert in experts])
        self._steps = self._ahead(MOST_STEPS)

    def _ahead(self, steps: int) -> NDArray[np.float64]:
        """Every expert's forecast of w, (experts, steps, 3)."""
        found = np.stack([expert.ahead(steps) for expert in self.experts.values()])
        return np.clip(found, -self._bounds, self._bounds)

    def _mixed(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Aggregate values (experts, ..., 3) of all experts to (..., 3)."""
        parts = [
            aggregation.weights @ values[speak][..., axis]
            for axis, (aggregation, speak) in enumerate(zip(self._aggregations, self._speak, strict=True))
        ]
        return np.stack(parts, axis=-1)

    @property
    def residual(self) -> Vector:
        """Estimated residual (3,); zero along axes in which none was ever seen."""
        return np.where(self._seen, self._mixed(self._residuals), 0.0)

    def ahead(self, steps: int) -> Matrix:
        """Forecast the next displacements (steps, 3): the next ideal move, then what follows if nothing is left."""
        found = self._induced(steps)
        residual = self.residual
        found[0, :2] = rotated(found[0, :2], float(residual[2]))
        found[0] += residual
        return found

    def step(self) -> Vector:
        """Forecast what the leader will induce next (3,), in the frame of the place where no residual is left."""
        return np.asarray(self._induced(1)[0])

    def _induced(self, steps: int) -> Matrix:
        found = self._mixed(self._steps[:, :steps] if steps <= MOST_STEPS else self._ahead(steps))
        if not self._seen[2]:
            found[:, 2] = self._last_turn
        return found

    def bias(self) -> Vector:
        """By how much the robot is expected to go farther than it is told, (3,)."""
        return self._bias.forecast()

    def diagnostics(self) -> Diagnostics:
        """Show K of the delay-embedded DMD, the experts' weights, the periods found, the residual and the bias."""
        notes: dict[str, str] = {}
        inner = Diagnostics()
        for expert in self.experts.values():
            if isinstance(expert, DmdExpert):
                inner = expert.model.diagnostics()
                notes = dict(inner.notes or {})
                if "delay" in expert.model.text:
                    break
        weights = self.weights()
        for along, of_axis in weights.items():
            notes[f"weights along {along}"] = ", ".join(f"{name} {share:.3f}" for name, share in of_axis.items())
        if (bank := self.experts.get("oscillators")) is not None and isinstance(bank, BankExpert):
            for axis, shares in bank.weights().items():
                notes[f"likeliest period along {AXES[axis]}"] = f"{self._periods[int(np.argmax(shares))]:.1f}"
        residual, bias = self.residual, self.bias()
        for name, value in (("residual [m]", residual[:2]), ("actuation bias [m]", bias[:2])):
            notes[name] = np.array2string(value, precision=6, separator=", ")
        for name, turn in (("residual turn [rad]", residual[2]), ("actuation bias of the turn [rad]", bias[2])):
            notes[name] = f"{turn:.6g}"
        return replace(inner, notes=notes, weights=weights)

    def weights(self) -> dict[str, dict[str, float]]:
        """Weight of each expert along each axis for which it speaks."""
        names = list(self.experts)
        return {
            axis: {names[number]: float(share) for number, share in zip(speak, aggregation.weights, strict=True)}
            for axis, aggregation, speak in zip(AXES, self._aggregations, self._speak, strict=True)
        }

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "experts": {name: expert.state() for name, expert in self.experts.items()},
            "aggregations": [aggregation.state() for aggregation in self._aggregations],
            "bias": self._bias.state(),
            "seen": [bool(seen) for seen in self._seen],
            "last_turn": self._last_turn,
            "begun": self._begun,
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        for name, expert in self.experts.items():
            expert.restore(state["experts"][name])
        for number, aggregation in enumerate(self._aggregations):
            aggregation.restore(state["aggregations"][number])
        self._bias.restore(state["bias"])
        seen = list(state["seen"])
        if len(seen) != 3:
            raise ValueError("what was seen has another length")
        self._seen = np.array([bool(value) for value in seen])
        self._begun = bool(state["begun"])
        (self._last_turn,) = vector([state["last_turn"]], 1).tolist()
        self._estimate()


def _experts(parameters: PredictorParameters, known: PriorKnowledge, chosen: Sequence[str]) -> dict[str, Expert]:
    """Make the experts by name; persistence comes first, since others take its filtered displacements."""
    closing, p = parameters.closing, parameters.formation
    levels = [
        (noise, level, trend, closing.trend_damping, closing.trend_start_m)
        for noise, level, trend in zip(closing.noise_m, closing.level_m, closing.trend_m, strict=True)
    ]
    both = levels + [
        (closing.noise_m[0], closing.level_m[0], trend, damping, p.trend_start_m)
        for trend, damping in zip(p.trend_m, p.trend_damping, strict=True)
    ]
    o = p.oscillators
    periods = periods_of(o)
    some = periods[::3]
    persistence = BankExpert(joined([trends(known, axis, levels) for axis in range(3)]), closing.discount)

    def made(name: str) -> Expert:
        if name == "persistence":
            return persistence
        if name == "trends":
            return BankExpert(joined([trends(known, axis, both) for axis in range(3)]), closing.discount)
        if name == "oscillators":
            model = joined([oscillators(known, axis, o, periods, 1) for axis in range(3)])
            return BankExpert(model, o.discount)
        if name == "overtones":
            return BankExpert(joined([oscillators(known, axis, o, some, 2) for axis in range(2)]), o.discount)
        if name == "rotation":
            signed = np.concatenate([periods, -periods, [math.inf]])
            return BankExpert(turning(known, o, signed, level=False), o.discount)
        if name == "dmd":
            return DmdExpert(EdmdParameters(dictionary="identity", prior=1e-3), persistence)
        delays = p.edmd if name == "delays 3" else EdmdParameters(dictionary="constant delay:6", prior=1.0)
        return DmdExpert(delays, persistence)

    return {name: made(name) for name in chosen}
