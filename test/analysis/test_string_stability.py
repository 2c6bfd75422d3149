"""Ratios and gains along chains, against transfers that are known."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Stamped
from robot_formation.analysis.string_stability import (
    Array,
    error_ratios,
    gains,
    geometric_mean,
    spectrum,
    string_stability,
    windows,
)
from robot_formation.geometry.se2 import Motion

WINDOW = 40


def periodic(period: float, timesteps: int, amplitude_m: float = 0.02) -> Array:
    return np.asarray(0.05 + amplitude_m * np.cos(2.0 * math.pi * np.arange(timesteps) / period))


def next_robot(steps: Array, feed_forward: float) -> Array:
    """Displacements of a robot whose place after a timestep is where its neighbour was, plus a share of its last step.

    x_i(t + 1) = x_(i-1)(t) + feed_forward (x_(i-1)(t) - x_(i-1)(t - 1)), from before the first displacement on.
    """
    place = np.concatenate([[0.0, 0.0], np.cumsum(steps)])
    own = place[1:-1] + feed_forward * (place[1:-1] - place[:-2])
    return np.diff(own, prepend=0.0)


def chain(leader: Array, feed_forward: float, robots: int) -> list[Array]:
    found = [leader]
    for _ in range(robots):
        found.append(next_robot(found[-1], feed_forward))
    return [np.column_stack([np.zeros_like(steps), steps]) for steps in found]


def persistence_gain(period: float) -> float:
    return math.sqrt(5.0 - 4.0 * math.cos(2.0 * math.pi / period))


@pytest.mark.parametrize("period", [4, 5, 8, 10, 20])
@pytest.mark.parametrize(("feed_forward", "delayed"), [(1.0, False), (0.0, True)])
def test_gains_are_those_of_the_law(period: int, feed_forward: float, delayed: bool) -> None:
    """With persistence and closing |T|^2 = 5 - 4 cos(theta); one timestep late |T| = 1."""
    motions = chain(periodic(period, 200), feed_forward, 3)
    lag = 3 if delayed else 0
    later = [motion[100 : 100 + WINDOW + 3 + lag] for motion in motions]  # the start has died away
    (found,) = gains(windows(later, delayed))
    expected = persistence_gain(period) if feed_forward else 1.0
    assert (found["axis"], found["period"]) == ("v", pytest.approx(period))
    assert found["amplitude_m"] == pytest.approx(0.02, rel=1e-6)
    assert found["hops"] == pytest.approx([expected] * 3)
    assert found["head_to_tail"] == pytest.approx(expected**3)


def test_a_delayed_chain_repeats_a_step_of_speed_exactly() -> None:
    """The windows are shifted with the robots, so that it is no matter that a step is not periodic."""
    leader = np.where(np.arange(30) < 15, 0.05, 0.02)
    found = gains(windows(chain(leader, 0.0, 5), delayed=True))
    assert found
    for entry in found:
        assert entry["hops"] == pytest.approx([1.0] * 5)


def test_a_leader_with_even_steps_has_no_dominant_frequency() -> None:
    noise = np.random.default_rng(1).normal(0.05, 0.0015, (3, WINDOW, 2))
    assert gains(list(noise)) == []


def test_short_runs_have_no_gains() -> None:
    assert gains(windows(chain(periodic(4, 10), 0.0, 1), delayed=False)) == []


@given(st.integers(4, 20), st.integers(1, 9), st.floats(0.001, 0.1), st.floats(-3.0, 3.0))
def test_amplitudes_are_those_of_the_cosines(half: int, cycles: int, amplitude_m: float, phase: float) -> None:
    count = 2 * half
    cycles = 1 + cycles % (half - 1)
    angles = 2.0 * math.pi * cycles * np.arange(count) / count
    found = np.abs(spectrum(0.05 + amplitude_m * np.cos(angles + phase)[:, None]))[:, 0]
    assert found[cycles] == pytest.approx(amplitude_m)
    far = [k for k in range(2, half + 1) if abs(k - cycles) > 1]
    assert found[far] == pytest.approx(np.zeros(len(far)), abs=1e-12)
    ends = spectrum(amplitude_m * np.cos(math.pi * np.arange(count))[:, None])
    assert abs(ends[-1, 0]) == pytest.approx(amplitude_m)


def test_white_errors_grow_by_the_root_of_five_per_robot_with_persistence() -> None:
    errors = np.random.default_rng(5).normal(0.0, 0.01, 40000)
    second = np.abs(next_robot(errors, 1.0))
    ((rms, _),) = error_ratios([list(np.abs(errors)), list(second)], delayed=False)
    assert rms == pytest.approx(math.sqrt(5.0), rel=0.02)


def test_error_ratios_leave_out_what_is_unknown_or_came_before_the_start() -> None:
    errors: list[list[float | None]] = [[None, 0.03, 0.04], [9.0, None, 0.05], [9.0, 9.0, 9.0, 0.01]]
    (first,), second = error_ratios(errors[:2], delayed=False), error_ratios(errors, delayed=True)
    assert list(first) == pytest.approx([math.sqrt((81.0 + 0.0025) / 2) / math.sqrt(0.00125), 9.0 / 0.04])
    assert list(second[0]) == pytest.approx([0.05 / math.sqrt(0.00125), 0.05 / 0.04])
    assert list(second[1]) == pytest.approx([0.2, 0.2])
    assert error_ratios([[0.0], [0.1], []], delayed=False) == [(None, None), (None, None)]


def test_a_run_tells_its_hops_and_the_whole_chain() -> None:
    motions = chain(periodic(5, 60), 0.0, 3)
    moved = [tuple(Stamped(t, Motion.from_uv(*step)) for t, step in enumerate(robot)) for robot in motions]
    followers = tuple(FollowerRecord(f"follower_{n}", displacements=moved[n]) for n in (1, 2, 3))
    delayed = {"parameters": json.dumps({"fine_tuner": {"spacing": "delayed"}})}
    record = RunRecord(moved[0], followers, details=delayed)
    found = string_stability(record, [[0.01] * 60, [0.02] * 60, [0.01] * 60])
    assert found is not None
    assert found["hops"] == [
        {"robot": "follower_2", "error_ratio_l2": pytest.approx(2.0), "error_ratio_linf": pytest.approx(2.0)},
        {"robot": "follower_3", "error_ratio_l2": pytest.approx(0.5), "error_ratio_linf": pytest.approx(0.5)},
    ]
    assert found["head_to_tail"] == {"error_ratio_l2": pytest.approx(1.0), "error_ratio_linf": pytest.approx(1.0)}
    assert found["gains"][0]["hops"] == pytest.approx([1.0] * 3)
    json.dumps(found, allow_nan=False)
    turning = RunRecord((*moved[0][:-1], Stamped(60, Motion(0.05, 0.0, 0.1))), followers, details=delayed)
    turned = string_stability(turning, [[0.01]] * 3)
    assert turned is not None
    assert turned["gains"] == []
    assert string_stability(RunRecord(moved[0], followers[:1]), [[0.01]]) is None


@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=30), st.floats(0.1, 10.0))
def test_a_geometric_mean_lies_in_its_interval_and_goes_with_the_unit(ratios: list[float], unit: float) -> None:
    found = geometric_mean(ratios)
    assert min(ratios) <= found.low * (1 + 1e-9)
    assert found.low <= found.mean * (1 + 1e-9)
    assert found.mean <= found.high * (1 + 1e-9)
    assert geometric_mean([unit * ratio for ratio in ratios]) == pytest.approx([unit * value for value in found])


def test_the_interval_tells_growth_from_chance() -> None:
    rng = np.random.default_rng(2)
    assert geometric_mean(list(np.exp(rng.normal(0.3, 0.2, 20)))).above_one
    assert not geometric_mean(list(np.exp(rng.normal(0.0, 0.2, 20)))).above_one
    assert geometric_mean([2.0, 0.5]).mean == pytest.approx(1.0)
    with pytest.raises(ValueError, match="above 0"):
        geometric_mean([1.0, 0.0])
