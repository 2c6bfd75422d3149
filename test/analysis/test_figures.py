"""Pictures of runs and sweeps: what their panels show, with units, and in which formats they are written."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_formation.analysis import eigenvalue_figure, error_figure, figures, sweep_figure
from robot_formation.analysis.eigenvalue_figure import draw_eigenvalues, eigenvalues_over
from robot_formation.analysis.error_figure import draw_formation_error, errors_over_time
from robot_formation.analysis.figures import draw_corrections, draw_trajectory
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import RunAnalysis, analyse
from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Stamped, Track
from robot_formation.analysis.style import FORMATS
from robot_formation.analysis.sweep_figure import draw_sweep
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import slot
from synthetic_bag import STEPS, write_run

DETAILS = {"scenario": "track two", "predictor": "measured", "surface": "ripple", "seed": "3", "timesteps": "7"}
BEGINNINGS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


@dataclass(frozen=True)
class Run:
    """A row of a sweep."""

    predictor: str
    seed: int
    correction_m: float | None
    lost: bool = False
    track: str = "two"
    path: str = "straight"
    surface: str = "bowl"
    prediction_coverage_90: float | None = None


@pytest.fixture
def saved(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Figures instead of files."""
    found: list[Any] = []

    def keep(figure: Any, path: str | Path) -> Path:
        found.append(figure)
        return Path(path)

    for module in (figures, error_figure, eigenvalue_figure, sweep_figure):
        monkeypatch.setattr(module, "save_figure", keep)
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunRecord, RunAnalysis]:
    bag = write_run(tmp_path_factory.mktemp("figures") / "run", STEPS, details=DETAILS, followers=2)
    record = load_run(bag)
    return record, analyse(record)


def test_the_trajectory_shows_places_direction_bodies_and_errors(
    run: tuple[RunRecord, RunAnalysis], saved: list[Any]
) -> None:
    record, analysis = run
    draw_trajectory(record, analysis, "x.png")
    above, below = saved[0].axes
    assert saved[0].get_suptitle() == "track two · ripple · measured predictor · seed 3 · incomplete"
    assert (above.get_xlabel(), above.get_ylabel(), above.get_aspect()) == ("x (cm)", "y (cm)", 1.0)
    assert (below.get_xlabel(), below.get_ylabel()) == ("timestep", "formation\nerror (cm)")
    labels = above.get_legend_handles_labels()[1]
    assert {"leader", "follower 1", "follower 2", "place in formation", "body at the start"} <= set(labels)
    assert not any("seen from above" in label for label in labels)
    places = next(line for line in above.lines if line.get_label() == "place in formation")
    assert len(places.get_xdata()) == 2 * len(STEPS)
    for line, follower in zip(below.lines, analysis.followers, strict=True):
        assert line.get_ydata() == pytest.approx([100.0 * (t.formation_error_m or 0.0) for t in follower.timesteps])
    assert below.get_xlim() == (0.5, 7.5)
    assert len(above.patches) == 2 * len(record.tracks)


def test_crosses_of_the_overhead_camera_only_when_asked_for(
    run: tuple[RunRecord, RunAnalysis], saved: list[Any]
) -> None:
    from robot_formation.analysis.run_record import OverheadTrack

    points = np.ones((4, 3))
    record = replace(run[0], overhead={"leader": OverheadTrack(np.arange(4), points, points)})
    draw_trajectory(record, run[1], "x.png", overhead=True)
    assert "dot as seen from above" in saved[0].axes[0].get_legend_handles_labels()[1]


def test_corrections_of_all_followers_have_one_scale_and_zero_is_marked(
    run: tuple[RunRecord, RunAnalysis], saved: list[Any]
) -> None:
    record, analysis = run
    small = replace(
        analysis.followers[1],
        timesteps=tuple(
            replace(t, corrections=replace(t.corrections, u_m=0.0, v_m=0.0)) for t in analysis.followers[1].timesteps
        ),
    )
    draw_corrections(record, replace(analysis, followers=(analysis.followers[0], small)), "x.png")
    upper, lower = saved[0].axes
    assert upper.get_ylim() == lower.get_ylim()
    assert upper.get_ylim()[1] > 100.0 * max(t.corrections.u_m + t.corrections.v_m for t in small.timesteps)
    zeros = next(line for line in lower.lines if line.get_label() == "no correction")
    assert len(zeros.get_xdata()) == len(small.timesteps)
    assert upper.get_ylabel() == "correction distance (cm)"


def test_errors_over_time_follow_the_definition() -> None:
    neighbour = Track(np.array([0, 20]), np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]]), np.array([0.0, 0.0]))
    own = Track(np.array([10, 30]), np.array([[0.0, -0.32, 0.0], [0.05, -0.30, 0.0]]), np.array([0.0, 0.1]))
    stamps, errors = errors_over_time(own, neighbour, slot(0.32))
    assert stamps.tolist() == [10, 20, 30]
    assert errors == pytest.approx([0.0, 0.05, 0.02])
    turned = replace(neighbour, yaws_rad=np.array([0.0, np.pi / 2]))  # its right is along +x now
    assert errors_over_time(own, turned, slot(0.32))[1][1] == pytest.approx(np.hypot(-0.05 - 0.32, -0.32))


def test_the_formation_error_has_time_on_its_axis_and_ends_of_timesteps(
    run: tuple[RunRecord, RunAnalysis], saved: list[Any]
) -> None:
    record, analysis = run
    draw_formation_error(record, analysis, "x.png")
    upper, lower = saved[0].axes
    assert lower.get_xlabel() == "simulated time (s)"
    assert upper.get_ylabel() == "formation error (cm)"
    marks = next(line for line in upper.lines if line.get_label() == "end of a timestep")
    wanted = [100.0 * t.formation_error_m for t in analysis.followers[0].timesteps if t.formation_error_m is not None]
    assert marks.get_ydata() == pytest.approx(wanted)


def test_eigenvalues_are_those_of_the_system_that_made_the_displacements(
    run: tuple[RunRecord, RunAnalysis], saved: list[Any]
) -> None:
    k = np.array([[0.9, -0.3], [0.3, 0.9]])
    moves = [np.array([0.01, 0.05])]
    for _ in range(6):
        moves.append(k @ moves[-1])
    displacements = tuple(Stamped(t, Motion.from_uv(*move.tolist())) for t, move in enumerate(moves, 1))
    follower = FollowerRecord("follower_1", displacements=displacements)
    found = eigenvalues_over(follower)
    assert [t for t, _ in found] == [3, 4, 5, 6, 7]
    for _, values in found:
        assert values == pytest.approx([0.9 + 0.3j, 0.9 - 0.3j])
    draw_eigenvalues(replace(run[0], followers=(follower,)), run[1], "x.png")
    plane, moduli = saved[0].axes[:2]
    assert (plane.get_xlabel(), plane.get_ylabel(), plane.get_aspect()) == ("real part", "imaginary part", 1.0)
    assert moduli.get_xlabel() == "timestep"
    assert plane.collections[0].get_offsets().data[:2].tolist() == [
        pytest.approx([0.9, 0.3]),
        pytest.approx([0.9, -0.3]),
    ]


def test_eigenvalues_without_enough_displacements_are_an_empty_picture(
    run: tuple[RunRecord, RunAnalysis], saved: list[Any]
) -> None:
    still = FollowerRecord("follower_1", displacements=(Stamped(1, Motion()),) * 2)
    assert eigenvalues_over(still) == []
    draw_eigenvalues(replace(run[0], followers=(still,)), run[1], "x.png")
    assert not saved[0].axes[0].collections


def test_the_sweep_pairs_seeds_and_puts_lost_runs_above_all_others(saved: list[Any]) -> None:
    rows = [Run("previous", seed, 0.10 + 0.01 * seed) for seed in range(5)]
    rows += [Run("formation", seed, 0.02, lost=seed == 3) for seed in range(5)]
    rows += [Run("previous", 0, 0.04, surface="plane")]
    draw_sweep(rows, "x.png")
    bowl, plane = saved[0].axes[:2]
    assert (bowl.get_title(), plane.get_title()) == ("track two · bowl", "track two · plane")
    assert bowl.get_ylabel() == "correction distance\nfrom timestep 4 on (cm)"
    assert [label.get_text() for label in bowl.get_xticklabels()] == ["previous", "formation"]
    pairs = [line for line in bowl.lines if line.get_color() == "0.80"]
    assert len(pairs) == 5
    assert [line.get_ydata()[0] for line in pairs] == pytest.approx([10, 11, 12, 13, 14])
    assert pairs[3].get_ydata()[1] > 14.0
    lost = [line for line in bowl.lines if line.get_label() == "lost run"]
    assert len(lost) == 1
    assert len(lost[0].get_xdata()) == 1
    assert "1 of 5" in [text.get_text() for text in bowl.texts]


@pytest.mark.parametrize("rows", [[Run("previous", 0, None)], [Run("previous", 0, None, lost=True)]])
def test_a_sweep_without_any_correction_is_drawn(rows: list[Run], tmp_path: Path) -> None:
    assert draw_sweep(rows, tmp_path / "x.svg").stat().st_size > 5000


@pytest.mark.parametrize("picture_format", FORMATS)
def test_pictures_are_written_in_every_format(
    picture_format: str, run: tuple[RunRecord, RunAnalysis], tmp_path: Path
) -> None:
    found = draw_corrections(*run, tmp_path / f"x.{picture_format}").read_bytes()
    assert found.startswith(BEGINNINGS[picture_format])
    if picture_format != "pdf":
        assert draw_corrections(*run, tmp_path / f"y.{picture_format}").read_bytes() == found
