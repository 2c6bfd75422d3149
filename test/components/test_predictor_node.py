"""The predictor on messages: one prediction per timestep, once all parts of its report are there."""

import itertools
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from component_helpers import Wire, wired
from robot_formation import conversions
from robot_formation.components.predictor import PredictorComponent
from robot_formation.geometry.se2 import Motion
from robot_formation.koopman.predictors import NAMES, PredictionError, Predictor, PredictorParameters


def report(motion: Motion, stamp_ns: int) -> tuple[Any, Any]:
    """A displacement and the residual with the same stamp."""
    base = "follower_1/base_link"
    return conversions.displacement(motion, base, stamp_ns), conversions.displacement(Motion(), base, stamp_ns)


@pytest.fixture
def wire() -> Wire:
    return wired("predictor", "follower_1", name="measured")


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["displacement first", "residual first"])
def test_it_answers_when_both_halves_are_there_whichever_comes_first(wire: Wire, order: tuple[int, int]) -> None:
    halves = [("displacement", "residual")[i] for i in order]
    messages = [report(Motion.from_uv(0.012, 0.05), 100)[i] for i in order]
    assert wire.give(halves[0], messages[0]) == []
    (forecast, _), (topic, message) = wire.give(halves[1], messages[1])
    assert (forecast, topic) == ("forecast", "prediction")
    assert conversions.stamp_of(message) == 100
    assert message.header.frame_id == "follower_1/base_link"
    found = conversions.read_displacement(message)
    assert (found.u_m, found.v_m) == (0.012, 0.05)


def test_halves_of_different_timesteps_are_no_pair(wire: Wire) -> None:
    assert wire.give("displacement", report(Motion(0.05), 100)[0]) == []
    assert wire.give("residual", report(Motion(0.05), 200)[1]) == []
    assert wire.component.details()["timesteps"] == "0"
    assert len(wire.give("residual", report(Motion(0.05), 100)[1])) == 2
    assert len(wire.give("displacement", report(Motion(0.06), 200)[0])) == 2


def test_a_residual_that_was_not_seen_is_half_of_a_pair_too(wire: Wire) -> None:
    displacement, _ = report(Motion(0.05), 7)
    unseen = conversions.displacement(Motion(), "follower_1/base_link", 7, conversions.NO_ESTIMATE)
    wire.give("displacement", displacement)
    assert len(wire.give("residual", unseen)) == 2


def test_predictions_and_covariances_are_the_models_own_with_u_and_v_turned_into_x_and_y() -> None:
    wire = wired("predictor", "follower_1", name="measured")
    model = Predictor(PredictorParameters(name="measured"))
    history = [(0.010, 0.050), (0.012, 0.049), (0.015, 0.051), (0.017, 0.047), (0.021, 0.048)]
    for stamp_ns, (u, v) in enumerate(history):
        displacement, residual = report(Motion.from_uv(u, v), stamp_ns)
        wire.give("displacement", displacement)
        *_, (_, message) = wire.give("residual", residual)
        model.observe(np.array([u, v, 0.0]), np.zeros(3))
        forecast = model.predict()
        found = conversions.read_displacement(message)
        assert (found.u_m, found.v_m) == tuple(forecast.mean[:2])
        xy = np.reshape(message.pose.covariance, (6, 6))[:2, :2]
        uu, uv, vv = forecast.covariance[0, 0], forecast.covariance[0, 1], forecast.covariance[1, 1]
        assert xy == pytest.approx(np.array([[vv, -uv], [-uv, uu]]), abs=1e-20)
    details = wire.component.details()
    assert details["timesteps"] == "5"
    assert {"K", "eigenvalues", "innovation [m]", "condition number"} <= set(details)
    assert not any("\n" in value for value in details.values())


def test_a_displacement_that_is_refused_is_warned_of_and_still_answered_from_what_is_known(wire: Wire) -> None:
    for message, topic in zip(report(Motion(0.05, 0.01), 1), ("displacement", "residual"), strict=True):
        wire.give(topic, message)
    displacement, residual = report(Motion(math.nan, 0.0), 2)
    wire.give("displacement", displacement)
    *_, (_, message) = wire.give("residual", residual)
    assert conversions.read_displacement(message) == Motion(0.05, 0.01)
    assert conversions.stamp_of(message) == 2
    assert "not finite" in wire.warnings[0]
    assert wire.component.details()["timesteps"] == "1"


def test_with_nothing_known_at_all_the_answer_says_that_it_is_no_estimate(wire: Wire) -> None:
    displacement, residual = report(Motion(math.nan, 0.0), 2)
    wire.give("displacement", displacement)
    *_, (_, message) = wire.give("residual", residual)
    assert not conversions.has_estimate(message)
    assert len(wire.warnings) == 2


def test_a_displacement_without_an_estimate_is_left_out_and_answered_from_what_is_known(wire: Wire) -> None:
    give(wire, 1, Motion(0.05, 0.01), order=("displacement", "residual"))
    none = conversions.displacement(Motion(), BASE, 2, conversions.NO_ESTIMATE)
    wire.give("displacement", none)
    *_, (_, message) = wire.give("residual", report(Motion(), 2)[1])
    assert conversions.read_displacement(message) == Motion(0.05, 0.01)
    assert "without an estimate" in wire.warnings[0]
    assert wire.component.details()["timesteps"] == "1"


def test_a_displacement_that_is_not_finite_is_warned_of_at_once(wire: Wire) -> None:
    wire.give("displacement", report(Motion(math.inf, 0.0), 2)[0])
    assert "displacement: (-0.0, inf) m, 0.0 rad is not finite" in wire.warnings[0]


@pytest.mark.parametrize("topic", [0, 1])
def test_halves_that_never_become_pairs_are_forgotten_with_a_warning(wire: Wire, topic: int) -> None:
    name = ("displacement", "residual")[topic]
    for stamp_ns in range(100):
        assert wire.give(name, report(Motion(0.05), stamp_ns)[topic]) == []
    assert isinstance(wire.component, PredictorComponent)
    assert len(wire.component._parts) == 16
    assert len(wire.warnings) == 84
    assert wire.warnings[0] == f"{name} of 0 ns came without the rest of the timestep and is forgotten"
    other = ("residual", "displacement")[topic]
    assert wire.give(other, report(Motion(0.05), 0)[1 - topic]) == []
    assert len(wire.give(other, report(Motion(0.05), 99)[1 - topic])) == 2


# --- commanded ------------------------------------------------------------------------------------------------------

BASE = "follower_1/base_link"
PARTS = ("commanded", "displacement", "residual")


def parts(
    stamp_ns: int, total: Motion, residual: Motion | None = None, commanded: Motion | None = None
) -> dict[str, Any]:
    """The three messages of a timestep; None where there is no estimate."""
    found = {}
    for name, motion in zip(PARTS, (commanded, total, residual), strict=True):
        covariance = conversions.NO_ESTIMATE if motion is None else (0.0,) * 4
        found[name] = conversions.displacement(motion or Motion(), BASE, stamp_ns, covariance)
    return found


def give(
    wire: Wire,
    stamp_ns: int,
    total: Motion,
    residual: Motion | None = None,
    commanded: Motion | None = None,
    order: Sequence[str] = PARTS,
) -> dict[str, list[tuple[str, Any]]]:
    """Hand in a timestep; the answers, by the part that they followed."""
    messages = parts(stamp_ns, total, residual or Motion(), commanded)
    return {name: wire.give(name, messages[name]) for name in order}


def test_commanded_is_waited_for_once_it_has_been_heard_of_in_an_earlier_timestep(wire: Wire) -> None:
    answers = give(wire, 1, Motion(0.05), commanded=Motion(0.05), order=("displacement", "residual", "commanded"))
    assert [len(answers[name]) for name in ("displacement", "residual", "commanded")] == [0, 2, 0]
    answers = give(wire, 2, Motion(0.05), commanded=Motion(0.05), order=("displacement", "residual", "commanded"))
    assert [len(answers[name]) for name in ("displacement", "residual", "commanded")] == [0, 0, 2]


def test_who_sends_no_commanded_gets_answers_too(wire: Wire) -> None:
    for stamp_ns in range(1, 5):
        answers = give(wire, stamp_ns, Motion(0.05), order=("displacement", "residual"))
        assert len(answers["residual"]) == 2


@pytest.mark.parametrize("name", ["formation", "previous", "measured+close"])
def test_what_is_learned_does_not_depend_on_the_order_in_which_the_parts_arrive(name: str) -> None:
    rng = np.random.default_rng(2)
    orders = itertools.cycle(itertools.permutations(PARTS))
    steady, shuffled = wired("predictor", "follower_1", name=name), wired("predictor", "follower_1", name=name)
    for stamp_ns in range(1, 20):
        total = Motion.from_uv(*rng.normal((0.01, 0.05), 0.002))
        residual = None if stamp_ns % 7 == 0 else Motion.from_uv(*rng.normal(0.0, 0.003, 2))
        commanded = None if stamp_ns % 5 == 0 else Motion.from_uv(total.u_m + 0.003, total.v_m - 0.002)
        messages = parts(stamp_ns, total, residual, commanded)
        for wire, order in ((steady, PARTS), (shuffled, next(orders))):
            for part in order:
                wire.give(part, messages[part])
    assert [str(message) for _, message in steady.sent] == [str(message) for _, message in shuffled.sent]
    assert len(steady.sent) == 2 * 19
    assert steady.warnings == []


def test_the_predictor_gets_residual_and_command_and_publishes_the_command() -> None:
    wire, model = wired("predictor", "follower_1", name="formation"), Predictor(PredictorParameters(name="formation"))
    rng = np.random.default_rng(2)
    for stamp_ns in range(1, 12):
        x, r = rng.normal((0.01, 0.05), 0.002), rng.normal(0.0, 0.003, 2)
        c = x + np.array([0.003, -0.002])
        none = stamp_ns == 6
        motions = [Motion.from_uv(*value) for value in (x, r, c)]
        answers = give(wire, stamp_ns, motions[0], motions[1], None if none else motions[2])
        # The first timestep's command is not used, in whatever order it comes.
        x, r, c = (np.append(value, 0.0) for value in (x, r, c))
        model.observe(x, r, None if none or stamp_ns == 1 else c)
        *_, (_, message) = [answer for found in answers.values() for answer in found]
        forecast, found = model.predict(), conversions.read_displacement(message)
        assert (found.u_m, found.v_m) == tuple(forecast.command[:2])
        about = forecast.about_command
        xy = np.reshape(message.pose.covariance, (6, 6))[:2, :2]
        assert xy == pytest.approx(np.array([[about[1, 1], -about[0, 1]], [-about[0, 1], about[0, 0]]]), abs=1e-20)
    assert isinstance(wire.component, PredictorComponent)
    assert wire.component.actuation_bias() == tuple((forecast.mean - forecast.command)[:2])
    assert max(map(abs, wire.component.actuation_bias())) > 0.001
    assert {"residual [m]", "actuation bias [m]", "weights along u"} <= set(wire.component.details())


# --- state file -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("variance", "expected_rad"), [(0.0, 0.0), (0.04, 0.2), (math.nan, 0.0), (math.inf, 0.0), (-1.0, 0.0), (1e3, 0.0)]
)
def test_the_variance_of_the_displacements_turn_reaches_the_predictor_if_it_is_one(
    monkeypatch: pytest.MonkeyPatch, variance: float, expected_rad: float
) -> None:
    wire = wired("predictor", "follower_1", name="formation")
    predictor, caught_up = wire.component.predictor, []
    observe = predictor.observe

    def watched(*parts: Any, caught_up_rad: float = 0.0) -> None:
        caught_up.append(caught_up_rad)
        observe(*parts, caught_up_rad=caught_up_rad)

    monkeypatch.setattr(predictor, "observe", watched)
    covariance = (*(0.0,) * 8, variance)
    wire.give("displacement", conversions.displacement(Motion(0.05), BASE, 5, covariance))
    wire.give("residual", conversions.displacement(Motion(), BASE, 5, (0.0,) * 9))
    assert caught_up == [pytest.approx(expected_rad)]


def drive(wire: Wire, stamps: Sequence[int], seed: int) -> list[str]:
    """Hand in random timesteps; the predictions."""
    rng = np.random.default_rng(seed)
    for stamp_ns in stamps:
        x, r = rng.normal((0.01, 0.05), 0.002), rng.normal(0.0, 0.003, 2)
        give(wire, stamp_ns, Motion.from_uv(*x), Motion.from_uv(*r), order=("displacement", "residual"))
    return [str(message) for _, message in wire.sent][-len(stamps) :]


@pytest.mark.parametrize("name", NAMES)
def test_a_restarted_predictor_goes_on_from_its_state_file(name: str, tmp_path: Path) -> None:
    values = {"name": name, "state_file": str(tmp_path / "{robot}.json"), "load_state": True}
    first = wired("predictor", "follower_1", **values)
    drive(first, range(1, 9), seed=1)
    assert [path.name for path in tmp_path.iterdir()] == ["follower_1.json"]
    second = wired("predictor", "follower_1", **values)
    assert second.component.details()["timesteps"] == "8"
    other = wired("predictor", "follower_2", **values)
    assert other.component.details()["timesteps"] == "0"
    unbroken = wired("predictor", "follower_1", name=name)
    drive(unbroken, range(1, 9), seed=1)
    assert drive(second, range(9, 20), seed=2) == drive(unbroken, range(9, 20), seed=2)
    assert first.warnings == second.warnings == []


def test_a_state_is_kept_but_not_loaded_unless_asked(tmp_path: Path) -> None:
    values = {"name": "measured", "state_file": str(tmp_path / "state.json")}
    drive(wired("predictor", "follower_1", **values), range(1, 5), seed=1)
    assert json.loads((tmp_path / "state.json").read_text())["observations"] == 4
    assert wired("predictor", "follower_1", **values).component.details()["timesteps"] == "0"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "can't read the predictor's state"),
        (b"{", "can't read the predictor's state"),
        (b"\xff\xfe", "can't read the predictor's state"),
        (b"[]", "can't be used"),
        (b"{}", "has no 'name'"),
        (b'{"name": "previous"}', "it is of 'previous', not of 'measured'"),
    ],
)
def test_a_state_file_that_can_not_be_used_is_refused_in_a_sentence(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "state.json"
    path.write_bytes(content)
    with pytest.raises(PredictionError) as refused:
        wired("predictor", "follower_1", name="measured", state_file=str(path), load_state=True)
    assert said in str(refused.value)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_folder_is_no_state_file_and_load_state_needs_one(tmp_path: Path) -> None:
    with pytest.raises(PredictionError, match="can't read the predictor's state"):
        wired("predictor", "follower_1", state_file=str(tmp_path), load_state=True)
    with pytest.raises(PredictionError, match="'load_state' needs the 'state_file'"):
        wired("predictor", "follower_1", load_state=True)


def test_a_state_that_can_not_be_kept_is_warned_of_and_the_run_goes_on(tmp_path: Path) -> None:
    wire = wired("predictor", "follower_1", state_file=str(tmp_path / "missing" / "state.json"))
    assert len(drive(wire, range(1, 3), seed=1)) == 2
    assert "can't keep the predictor's state" in wire.warnings[0]
