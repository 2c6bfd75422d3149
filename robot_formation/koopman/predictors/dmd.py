"""Models that forecast by a finite-dimensional Koopman operator K, learned from pairs of displacements."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.online_dmd import OnlineDMD
from robot_formation.koopman.predictors.dictionary_text import dictionary_from_text
from robot_formation.koopman.predictors.models import Diagnostics, Matrix, Vector, array, optional, vector
from robot_formation.koopman.predictors.pair_log import PairLog
from robot_formation.koopman.predictors.parameters import EdmdParameters, PredictorParameters
from robot_formation.koopman.windowed_dmd import WindowedDMD

# An open-loop power of K may grow as it likes; this is far beyond any forecast and far below overflow.
_LARGEST_STATE_M = 1e100
# No robot goes farther in a timestep; monomials of what is put into the delays blindly must stay finite.
_LARGEST_BLIND_M = 10.0
# Noise of a displacement, by which diagnostics tell eigenvalues of the leader's from those of noise.
_NOISE_M = 0.0025


class Literal:
    """The paper's Algorithm 1 as printed: K from the first three displacements, then K^n x_3, blind to what follows.

    The printed loop feeds its own forecast back as the measurement, so its innovation y - K x is zero and K stays.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self._collected: list[Vector] = []
        self._k: Matrix | None = None
        self._state: Vector = np.zeros(2)

    def __repr__(self) -> str:
        return "Literal()"

    def observe(self, x: Vector) -> None:
        """See `Model`; from the fourth on only the number of observations matters."""
        if self._k is not None:
            self.advance()
            return
        self._collected.append(x)
        self._state = x
        if len(self._collected) == 3:
            data = np.column_stack(self._collected)
            self._k = data[:, 1:] @ np.linalg.pinv(data[:, :-1])

    def advance(self) -> None:
        """See `Model`; three displacements are needed, however long they take."""
        if self._k is not None:
            self._state = np.clip(self._k @ self._state, -_LARGEST_STATE_M, _LARGEST_STATE_M)

    def forecast(self) -> Vector:
        """See `Model`."""
        return self._state if self._k is None else self._k @ self._state

    def ahead(self, steps: int) -> Matrix:
        """See `Model`."""
        if self._k is None:
            return np.repeat(self._state[None], steps, axis=0)
        return powers(self._k, self._state, steps)

    def diagnostics(self) -> Diagnostics:
        """See `Model`."""
        condition = None
        if self._k is not None:
            condition = float(np.linalg.cond(np.column_stack(self._collected[:-1])))
        return Diagnostics(k=self._k, condition_number=condition)

    def state(self) -> JsonObject:
        """See `Model`."""
        return {
            "collected": [x.tolist() for x in self._collected],
            "k": None if self._k is None else self._k.tolist(),
            "state": self._state.tolist(),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Model`."""
        self._collected = [vector(x) for x in state["collected"]]
        self._k = None if state["k"] is None else array(state["k"], 2, 2)
        self._state = vector(state["state"])


class Measured:
    """Online DMD with measured pairs: what the paper's algorithm must have been to react to anything.

    Forecast K x_t, with K the least-squares fit of all pairs (x_i, x_i+1) so far; the previous displacement until the
    first two pairs are complete, as in the paper's collection phase.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self._dmd = OnlineDMD(2, forgetting=parameters.forgetting)
        self._pairs = 0
        self._last: Vector | None = None
        self._measured = True
        self._innovation: Vector | None = None
        self._log = PairLog(2)

    def __repr__(self) -> str:
        return f"Measured({self._dmd!r})"

    def observe(self, x: Vector) -> None:
        """See `Model`; a pair is learned from only if both of its displacements were measured."""
        if self._last is not None and self._measured:
            self._innovation = self._dmd.learn(self._last, x)  # checked by the predictor
            self._pairs += 1
            self._log.add(self._last, x)
        self._last, self._measured = x, True

    def advance(self) -> None:
        """See `Model`."""
        if self._last is not None:
            self._last, self._measured = np.clip(self.forecast(), -_LARGEST_STATE_M, _LARGEST_STATE_M), False

    def forecast(self) -> Vector:
        """See `Model`."""
        assert self._last is not None  # by the protocol
        return self._last if self._pairs < 2 else self._dmd.k.dot(self._last)

    def ahead(self, steps: int) -> Matrix:
        """See `Model`."""
        assert self._last is not None  # by the protocol
        return powers(np.eye(2) if self._pairs < 2 else self._dmd.k, self._last, steps)

    def diagnostics(self) -> Diagnostics:
        """See `Model`."""
        if self._pairs < 2:
            return Diagnostics()
        consistency, qualities = self._log.judge(self._dmd.k, np.full(2, _NOISE_M))
        return Diagnostics(
            self._dmd.k, self._dmd.condition_number, self._innovation, consistency=consistency, qualities=qualities
        )

    def state(self) -> JsonObject:
        """See `Model`."""
        return {
            "dmd": self._dmd.state(),
            "pairs": self._pairs,
            "last": optional(self._last),
            "measured": self._measured,
            "innovation": optional(self._innovation),
            "log": self._log.state(),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Model`."""
        _require_same_settings(self._dmd, state["dmd"])
        self._dmd = OnlineDMD.from_state(state["dmd"])
        self._pairs = int(state["pairs"])
        self._last = vector(state["last"]) if state["last"] is not None else None
        self._measured = bool(state["measured"])
        self._log.restore(state["log"])
        self._innovation = vector(state["innovation"]) if state["innovation"] is not None else None


class Edmd:
    """Online EDMD with a dictionary of the user's: K Psi(x_t), with persistence (K = I) as the prior.

    Displacements are divided by a length first, so that observables of different degree are alike in size.
    """

    def __init__(self, parameters: PredictorParameters | EdmdParameters) -> None:
        p = self._p = parameters.edmd if isinstance(parameters, PredictorParameters) else parameters
        self._dictionary = dictionary_from_text(p.dictionary)
        self.text = p.dictionary
        """The dictionary in words."""
        self._rows = [row for row in self._dictionary.state_rows if row is not None]
        size = self._dictionary.size
        self._dmd: OnlineDMD | WindowedDMD = (
            WindowedDMD(size, p.window, forgetting=p.forgetting, prior_weight=p.prior)
            if p.window
            else OnlineDMD(size, forgetting=p.forgetting, prior_weight=p.prior)
        )
        self._history: list[Vector] = []
        self._lifted: Vector | None = None
        self._measured = True
        self._innovation: Vector | None = None
        self._log = PairLog(size)

    def __repr__(self) -> str:
        return f"Edmd('{self.text}', {self._dmd!r})"

    def observe(self, x: Vector) -> None:
        """See `Model`; a pair is learned from only if its second displacement and the one before were measured."""
        lifted = self._lift(x)
        if lifted is not None:
            if self._lifted is not None and self._measured:
                self._innovation = self._dmd.update(self._lifted, lifted)
                self._log.add(self._lifted, lifted)
            self._lifted = lifted
        self._measured = True

    def advance(self) -> None:
        """See `Model`."""
        if self._history:
            lifted = self._lift(np.clip(self.forecast(), -_LARGEST_BLIND_M, _LARGEST_BLIND_M))
            self._lifted, self._measured = (self._lifted if lifted is None else lifted), False

    def _lift(self, x: Vector) -> Vector | None:
        """Append a displacement; return the observables, None until the delays are filled."""
        self._history = [*self._history[-self._dictionary.history :], x] if self._dictionary.history else [x]
        if len(self._history) <= self._dictionary.history:
            return None
        return np.asarray(self._dictionary(np.column_stack(self._history) / self._p.scale_m)[:, 0])

    def forecast(self) -> Vector:
        """See `Model`; the last displacement until the delays are filled."""
        if self._lifted is None:
            return self._history[-1]
        return np.asarray(self._p.scale_m * (self._dmd.k[self._rows] @ self._lifted))

    def ahead(self, steps: int) -> Matrix:
        """See `Model`."""
        if self._lifted is None:
            return np.repeat(self._history[-1][None], steps, axis=0)
        return np.asarray(self._p.scale_m * powers(self._dmd.k, self._lifted, steps)[:, self._rows])

    def diagnostics(self) -> Diagnostics:
        """See `Model`; the innovation is that of the state, in metres."""
        innovation = None if self._innovation is None else self._p.scale_m * self._innovation[self._rows]
        notes = {"observables": ", ".join(self._dictionary.names)}
        constant = np.array([name == "1" for name in self._dictionary.names])
        noise = np.where(constant, 0.0, _NOISE_M / self._p.scale_m)
        consistency, qualities = self._log.judge(self._dmd.k, noise)
        return Diagnostics(
            self._dmd.k, self._dmd.condition_number, innovation, notes, consistency=consistency, qualities=qualities
        )

    def state(self) -> JsonObject:
        """See `Model`."""
        return {
            "dmd": self._dmd.state(),
            "history": [x.tolist() for x in self._history],
            "lifted": optional(self._lifted),
            "measured": self._measured,
            "innovation": optional(self._innovation),
            "log": self._log.state(),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Model`."""
        _require_same_settings(self._dmd, state["dmd"])
        self._dmd = type(self._dmd).from_state(state["dmd"])
        size = self._dictionary.size
        self._history = [vector(x) for x in state["history"]]
        self._lifted = vector(state["lifted"], size) if state["lifted"] is not None else None
        self._measured = bool(state["measured"])
        self._log.restore(state["log"])
        self._innovation = vector(state["innovation"], size) if state["innovation"] is not None else None


def powers(k: Matrix, x: Vector, steps: int) -> Matrix:
    """Return K x, K^2 x, ..., (steps, n); growth is cut far beyond any forecast."""
    found = np.empty((steps, len(x)))
    for step in range(steps):
        x = found[step] = np.clip(k.dot(x), -_LARGEST_STATE_M, _LARGEST_STATE_M)
    return found


def _require_same_settings(fresh: OnlineDMD | WindowedDMD, state: Mapping[str, Json]) -> None:
    """Refuse a fit that was made with other settings: it would go on with those.

    Raises:
        ValueError: if the settings differ.
    """
    if state["settings"] != fresh.state()["settings"]:
        raise ValueError("it was learned with other parameters (dictionary, prior, window or forgetting)")
