"""The standard figures on axes of one's own, and predictors on displacements of one's own."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import robot_formation as rf
from repository import ROOT
from robot_formation.analysis.from_bag import load_displacements
from robot_formation.cli.main import main
from robot_formation.experiment.sweep import Plan, Row

pytestmark = pytest.mark.xdist_group("plots")

SAMPLE = ROOT / "bags" / "samples" / "track_two_formation"
STEPS = np.array([[0.001 * (-1) ** t, 0.05 + 0.002 * t] for t in range(12)])


@pytest.fixture(scope="module")
def run() -> rf.Run:
    return rf.analyze(SAMPLE)


def sweep_of(surfaces: tuple[str, ...]) -> rf.Sweep:
    plan = Plan(("mine",), surfaces, ("previous", "measured"), (0, 1, 2))
    rows = [Row(*task, "done", 15, 0.1 * (task.seed + 1), *[0.2] * 7) for task in plan.tasks()]
    lost = [replace(row, outcome="lost") if row.seed == 2 and row.predictor == "measured" else row for row in rows]
    return rf.Sweep(plan, tuple(lost))


PLOTS: dict[str, tuple[Callable[..., Axes], str, str]] = {
    "trajectory": (rf.plot_trajectory, "x (cm)", "y (cm)"),
    "corrections": (rf.plot_corrections, "timestep", "correction distance (cm)"),
    "errors": (rf.plot_errors, "simulated time (s)", "formation error (cm)"),
    "eigenvalues": (rf.plot_eigenvalues, "real part", "imaginary part"),
}


@pytest.mark.parametrize("name", PLOTS)
def test_a_plot_draws_into_the_axes_that_it_is_given_and_no_others(name: str, run: rf.Run) -> None:
    draw, x, y = PLOTS[name]
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert draw(run, right) is right
    assert (right.get_xlabel(), right.get_ylabel()) == (x, y)
    assert right.has_data()
    assert not left.has_data()
    assert pyplot.get_fignums() == []


def test_a_plot_without_axes_makes_a_figure_of_pyplot(run: rf.Run, monkeypatch: pytest.MonkeyPatch) -> None:
    pyplot.switch_backend("Agg")
    axes = rf.plot_corrections(run)
    try:
        assert pyplot.gcf() is axes.figure
        heights = [bar.get_height() for bar in axes.patches if isinstance(bar, Rectangle)]
        corrections = 100.0 * run.followers["follower_1"].corrections
        assert {round(height, 9) for height in corrections.ravel().tolist()} <= {round(height, 9) for height in heights}
    finally:
        pyplot.close("all")


def test_the_errors_drawn_are_those_of_the_run(run: rf.Run) -> None:
    axes = rf.plot_errors(run, Figure().subplots())
    (ends,) = [line for line in axes.lines if line.get_label() == "end of a timestep"]
    np.testing.assert_allclose(np.asarray(ends.get_ydata(), float), 100.0 * run.followers["follower_1"].formation_error)


def test_a_follower_that_is_not_there_is_named(run: rf.Run) -> None:
    for draw in (rf.plot_corrections, rf.plot_errors, rf.plot_eigenvalues):
        with pytest.raises(rf.FormationError, match=r"no follower 'follower_2'; did you mean 'follower_1'\?"):
            draw(run, follower="follower_2")
    assert pyplot.get_fignums() == []


def test_a_sweep_on_axes_lists_each_label_once() -> None:
    axes = Figure().subplots()
    assert rf.plot_sweep(sweep_of(("bowl",)), axes) is axes
    legend = axes.get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert sorted(labels) == sorted(set(labels))
    assert {"run", "lost run", "median"} <= set(labels)
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["previous", "measured"]


def test_of_several_groups_of_runs_one_has_to_be_chosen() -> None:
    sweep = sweep_of(("bowl", "plane"))
    with pytest.raises(rf.FormationError, match="2 groups of runs that fit; choose one of: track='mine'"):
        rf.plot_sweep(sweep)
    with pytest.raises(rf.FormationError, match="0 groups of runs that fit"):
        rf.plot_sweep(sweep, surface="saddle")
    assert rf.plot_sweep(sweep, Figure().subplots(), surface="plane").has_data()
    assert pyplot.get_fignums() == []


# --- forecasts --------------------------------------------------------------------------------------------------------


def test_previous_forecasts_the_displacement_before() -> None:
    found = rf.forecast("previous", STEPS, horizon=2)
    assert found.means.shape == STEPS.shape
    assert np.isnan(found.means[0]).all()
    np.testing.assert_array_equal(found.means[1:], STEPS[:-1])
    np.testing.assert_array_equal(found.targets, STEPS)
    np.testing.assert_allclose(found.ahead, [[*STEPS[-1], 0.0]] * 2)
    assert found.ahead_covariances.shape == (2, 3, 3)
    assert found.covariances.shape == (12, 2, 2)
    assert [errors["h"] for errors in found.errors_ahead] == [1, 2]
    rmse = np.sqrt(np.mean(np.sum(np.diff(STEPS, axis=0) ** 2, axis=1)))
    assert found.errors["rmse"] == pytest.approx(rmse)
    assert repr(found) == f"<Forecasts of 'previous', 12 timesteps, RMSE {1e3 * rmse:.2f} mm>"


@pytest.mark.parametrize("predictor", rf.predictors())
def test_every_predictor_forecasts_plain_lists(predictor: str) -> None:
    found = rf.forecast(predictor, STEPS.tolist(), 3)
    assert np.isfinite(found.means[1:]).all()
    assert found.ahead.shape == (3, 3)


def test_forecasts_of_a_runs_log_are_those_of_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    import json

    log = load_displacements(SAMPLE, "follower_1")
    moved = np.column_stack([log.displacements_m, log.turns_rad])
    settings = {"predictor.forgetting": 0.9}
    found = rf.forecast("measured", moved, 2, residuals=log.residuals_m, commanded=log.commanded_m, settings=settings)
    options = ["--predictors", "measured", "--horizon", "2", "--set", "predictor.forgetting=0.9", "--json"]
    assert main(["predict", "--bag", str(SAMPLE), *options]) == 0
    printed = json.loads(capsys.readouterr().out)["predictors"]["measured"]
    assert [None, *found.means[1:].tolist()] == printed["forecast"]
    assert (found.errors, list(found.errors_ahead)) == (printed["error_m"], printed["horizon"])
    assert found.model["k"] == printed["k"]
    follower = rf.analyze(SAMPLE).followers["follower_1"]
    np.testing.assert_array_equal(follower.moved, log.displacements_m)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"predictor": "mesured"}, "predictor: no predictor 'mesured'; did you mean 'measured'"),
        ({"displacements": [0.0, 0.05]}, r"an array \(n, 2\).*not \(2,\)"),
        ({"displacements": np.empty((0, 2))}, r"an array \(n, 2\).*not \(0, 2\)"),
        ({"displacements": [["a", "b"]]}, "array of numbers"),
        ({"displacements": [[0.0, 0.05], [0.0, np.nan]]}, "timestep 2: .*not finite"),
        ({"displacements": [[0.0, 50.0]]}, "timestep 1: .*no robot goes so far"),
        ({"residuals": [[0.0, 0.0]]}, r"residuals is an array \(12, 2\).*not \(1, 2\)"),
        ({"horizon": 0}, "horizon is a whole number from 1 to 50, not 0"),
        ({"horizon": 1.5}, "horizon is a whole number"),
        ({"horizon": True}, "horizon is a whole number"),
        ({"residuals": [[0.0, 0.0]] * 3 + [[0.0, np.inf]] + [[0.0, 0.0]] * 8}, "residuals, timestep 4: .*finite"),
        ({"commanded": [[np.nan, np.nan]] + [[np.nan, 0.0]] * 11}, "commanded, timestep 2: .*finite"),
        ({"settings": {"predictor.forgeting": 0.9}}, "did you mean 'forgetting'"),
        ({"settings": {"leader.timesteps": 3}}, "settings leader.timesteps: a log has no scenario"),
        ({"settings": {"predictor.name": "ewma"}}, "settings predictor.name: name predictors by predictor"),
    ],
)
def test_what_is_wrong_with_a_forecast_is_told_in_a_line(arguments: dict[str, Any], words: str) -> None:
    given = {"predictor": "previous", "displacements": STEPS, **arguments}
    with pytest.raises(rf.FormationError, match=words):
        rf.forecast(**given)


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda run: rf.plot_trajectory("x"), "give a run, like analyze.*not 'x'"),  # type: ignore[arg-type]
        (lambda run: rf.plot_corrections(run, follower=1), "no follower '1'"),  # type: ignore[arg-type]
        (lambda run: rf.plot_errors(run, "follower_1"), "axes are those of a mat.*'follower_1'"),  # type: ignore[arg-type]
        (lambda run: rf.plot_sweep(run), "give a sweep, like load_sweep.*not <Run"),
        (lambda run: run.save_pictures("pictures", "bmp"), "kind is one of png, svg, pdf, not 'bmp'"),
        (lambda run: sweep_of(("bowl",)).save_picture("x.xyz"), "x.xyz: pictures are .png, .svg or .pdf files"),
    ],
)
def test_what_cannot_be_drawn_is_told_in_a_line(draw: Callable[[Any], object], words: str, run: rf.Run) -> None:
    with pytest.raises(rf.FormationError, match=words):
        draw(run)
    assert pyplot.get_fignums() == []


def test_a_horizon_may_be_a_number_of_numpy() -> None:
    assert rf.forecast("previous", STEPS, np.int64(2)).ahead.shape == (2, 3)  # type: ignore[arg-type]
