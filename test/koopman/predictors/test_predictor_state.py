"""A predictor's state: JSON and back goes on to the last bit, and what is damaged is refused in a sentence."""

import copy
import json
import pickle
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pytest

from cases import case
from predictor_helpers import predictor, timesteps
from robot_formation.errors import FormationError
from robot_formation.koopman.predictors import NAMES, PredictionError, Predictor, PredictorParameters
from robot_formation.koopman.predictors.parameters import ClosingParameters, EdmdParameters, FormationParameters

Path = tuple[int | str, ...]
"""Keys and indices that lead to a value in nested mappings and lists."""

pytestmark = pytest.mark.slow

VARIANTS: dict[str, dict[str, Any]] = {
    **{name: {"name": name} for name in NAMES},
    "edmd, windowed": {"name": "edmd", "edmd": EdmdParameters(window=5, forgetting=0.9)},
    "edmd+close, delayed": {"name": "edmd+close", "edmd": EdmdParameters(dictionary="constant delay:3")},
    "measured, forgetting": {"name": "measured", "forgetting": 0.8},
    "formation, rbf": {
        "name": "formation",
        "formation": FormationParameters(edmd=EdmdParameters(dictionary="rbf:3 identity", prior=0.1)),
    },
}


@pytest.fixture(params=VARIANTS)
def values(request: pytest.FixtureRequest) -> dict[str, Any]:
    return VARIANTS[request.param]


def shown(values: dict[str, Any], count: int) -> Predictor:
    found = predictor(**values)
    for timestep in timesteps(count):
        found.observe(*timestep)
    return found


def diagnostics(found: Predictor) -> tuple[Any, ...]:
    seen = found.diagnostics()
    arrays = [None if part is None else part.tolist() for part in (seen.k, seen.innovation)]
    return arrays, seen.condition_number, seen.notes, seen.weights, seen.consistency, seen.qualities


def test_json_and_back_goes_on_to_the_last_bit(values: dict[str, Any]) -> None:
    for count in (0, 1, 2, 3, 4, 12, 40):
        with case(f"after {count} timesteps"):
            check_json_and_back(values, count)


def check_json_and_back(values: dict[str, Any], count: int) -> None:
    one = shown(values, count)
    text = json.dumps(one.state(), allow_nan=False)
    other = Predictor.from_state(PredictorParameters(**values), json.loads(text))
    assert other.observations == count
    assert json.dumps(other.state()) == text
    if count:
        assert all((a == b).all() for a, b in zip(one.predict(), other.predict(), strict=True))
    assert diagnostics(one) == diagnostics(other)
    for timestep in timesteps(12, seed=9):
        one.observe(*timestep)
        other.observe(*timestep)
        assert all((a == b).all() for a, b in zip(one.predict(), other.predict(), strict=True))
    assert diagnostics(one) == diagnostics(other)


def test_a_state_is_of_the_moment_when_it_was_taken(values: dict[str, Any]) -> None:
    found = shown(values, 10)
    state = found.state()
    before = copy.deepcopy(state)
    for timestep in timesteps(10, seed=2):
        found.observe(*timestep)
    assert state == before


def paths(value: Any, path: Path = ()) -> Iterator[Path]:
    """Every place in nested lists and mappings; of a list its ends, since what reads one item reads all."""
    yield path
    items: Iterable[tuple[int | str, Any]] = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list) and value:
        items = ((number, value[number]) for number in sorted({0, len(value) - 1}))
    for key, inner in items:
        yield from paths(inner, (*path, key))


MANY = 100
"""Places of a state from which on not all are tried with each kind of damage."""


def damaged(state: bytes, path: Path, wrong: Any) -> Any:
    """Return a pickled state with a place of it changed; `copy.deepcopy` takes five times as long."""
    found = pickle.loads(state)
    if not path:
        return wrong
    place = found
    for key in path[:-1]:
        place = place[key]
    if wrong == "missing":
        del place[path[-1]]
    else:
        place[path[-1]] = wrong
    return found


def test_a_damaged_state_is_refused_in_a_sentence_or_does_no_harm(values: dict[str, Any]) -> None:
    wrong: Any
    for number, wrong in enumerate((None, float("nan"), float("inf"), "text", [], {}, [[1.0]], -1, "missing")):
        with case(repr(wrong)):
            check_damaged_states(values, wrong, number)


def check_damaged_states(values: dict[str, Any], wrong: Any, number: int) -> None:
    """Damage a state at its places in turn; of many places every ninth, others with each kind of damage."""
    parameters = PredictorParameters(**values)
    state = shown(values, 6).state()
    refusals = []
    pickled = pickle.dumps(state)
    places = list(paths(state))
    for path in places if len(places) <= MANY else places[number % 9 :: 9]:
        try:
            found = Predictor.from_state(parameters, damaged(pickled, path, wrong))
        except PredictionError as error:
            refusals.append(str(error))
            continue
        for timestep in timesteps(3, seed=4):
            found.observe(*timestep)
            assert np.isfinite(found.predict().mean).all()
            assert np.isfinite(found.predict().covariance).all()
    assert len(refusals) > 5
    for text in refusals:
        assert text.startswith("the stored state of the predictor ")
        assert "\n" not in text


def test_nothing_that_is_not_finite_gets_in(values: dict[str, Any]) -> None:
    parameters = PredictorParameters(**values)
    state = shown(values, 6).state()
    pickled = pickle.dumps(state)
    for path in paths(state):
        place: Any = state
        for key in path:
            place = place[key]
        if isinstance(place, float):
            with pytest.raises(PredictionError):
                Predictor.from_state(parameters, damaged(pickled, path, float("nan")))


@pytest.mark.parametrize(
    ("learned", "asked", "said"),
    [
        ({"name": "measured"}, {"name": "previous"}, "it is of 'measured', not of 'previous'"),
        ({"name": "ewma"}, {"name": "ewma+close"}, "it is of 'ewma', not of 'ewma+close'"),
        ({"name": "measured"}, {"name": "measured", "forgetting": 0.9}, "other parameters"),
        ({"name": "edmd"}, {"name": "edmd", "edmd": EdmdParameters(prior=0.5)}, "other parameters"),
        ({"name": "edmd"}, {"name": "edmd", "edmd": EdmdParameters(window=9)}, "other parameters"),
        ({"name": "edmd"}, {"name": "edmd", "edmd": EdmdParameters(dictionary="identity")}, "other parameters"),
        (
            {"name": "formation"},
            {"name": "formation", "closing": ClosingParameters(noise_m=(0.1,), level_m=(0.1,), trend_m=(0.1,))},
            "packed numbers are expected",
        ),
    ],
)
def test_a_state_of_another_predictor_is_refused(learned: dict[str, str], asked: dict[str, Any], said: str) -> None:
    state = shown(learned, 5).state()
    with pytest.raises(FormationError) as refused:
        Predictor.from_state(PredictorParameters(**asked), state)
    assert said in str(refused.value)


def test_a_state_of_the_version_without_turns_is_refused_and_the_line_says_so() -> None:
    old = {"name": "previous", "model": {"last": [0.0, 0.05]}, "errors": [[1e-5, 0.0], [0.0, 1e-5]], "weight": 2.0}
    with pytest.raises(PredictionError, match="earlier version, which knew no turns; remove the file") as refused:
        Predictor.from_state(PredictorParameters(name="previous"), {**old, "expected": None, "observations": 1})
    assert "\n" not in str(refused.value)
