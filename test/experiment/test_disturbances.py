"""Loss of the neighbour and disturbed pictures, each as a script with its outcome: single alignments, and one run."""

import itertools
import math
from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from alignment_grid import equipment
from robot_formation import exit_codes
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.bag.reader import read_bag
from robot_formation.calibration.alignment_trial import AlignmentTrial, Start
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import load_track, override
from robot_formation.vision.pixy2.block_tracking import ClockError
from robot_formation.vision.pixy2.detector import BlockDetector

pytestmark = pytest.mark.slow

LOOK = 22  # frames
BESIDE = Start(0.36, -0.05, 0.0)
GREY = 90
EQUIPMENT = equipment("precise", ["fine_tuner.precise.certain_rad=0.03"])


def align(tamper=None, spoil=None, seed=3):
    return AlignmentTrial(EQUIPMENT, BESIDE, seed, tamper, spoil).run()


def assert_in_formation(trial):
    assert trial.outcome == "aligned"
    u_m, v_m, heading_rad = trial.errors
    assert abs(u_m) < 0.015
    assert abs(v_m) < 0.015
    assert abs(heading_rad) < math.radians(6.0)
    assert not trial.touched


def words(trial):
    return [state.split(":")[0] for state in trial.states]


def during(first, last, disturbance):
    """A disturbance of the frames first to last - 1."""
    return lambda picture, number: disturbance(picture) if first <= number < last else picture


def marker_box(picture):
    """Rows and columns of the saturated colours: the marker."""
    colour = picture.max(axis=2).astype(int) - picture.min(axis=2)
    rows, columns = np.nonzero(colour > 70)
    return slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)


def hidden(picture):
    changed = picture.copy()
    changed[marker_box(picture)] = GREY
    return changed


def half_covered(picture):
    changed = picture.copy()
    rows, columns = marker_box(picture)
    changed[rows, columns.start : (columns.start + columns.stop) // 2] = GREY
    return changed


def test_without_any_disturbance_it_comes_into_formation():
    trial = align()
    assert_in_formation(trial)
    assert "hold" not in words(trial)


def test_a_neighbour_that_is_hidden_for_a_while_is_reacquired():
    trial = align(spoil=during(LOOK, 3 * LOOK, hidden))
    assert {"hold", "reacquired"} <= set(words(trial))
    assert_in_formation(trial)


def test_a_neighbour_that_is_hidden_for_longer_is_searched_for():
    trial = align(spoil=during(LOOK, 6 * LOOK, hidden))
    assert words(trial).index("hold") < words(trial).index("search") < words(trial).index("reacquired")
    assert_in_formation(trial)


def test_a_neighbour_that_is_gone_for_good_is_lost_after_a_bound():
    trial = align(spoil=during(LOOK, 10**9, hidden))
    assert trial.outcome == "lost"
    assert words(trial).count("search") <= 10


def test_a_marker_that_is_partly_covered_for_a_while_is_waited_for():
    trial = align(spoil=during(LOOK, 3 * LOOK, half_covered))
    assert_in_formation(trial)


@pytest.mark.parametrize("since", [0, LOOK])
@pytest.mark.parametrize("corner", [(130, 20), (150, 270)])
def test_an_object_of_the_targets_colour_is_no_neighbour(corner, since):
    patches = []

    def distract(picture, number):
        if number == 0:
            rows, columns = marker_box(picture)
            patches.append(picture[rows, columns][:30, :30].copy())
        changed = picture.copy()
        row, column = corner
        if number >= since:
            changed[row : row + 30, column : column + 30] = patches[0]
        return changed

    assert_in_formation(align(spoil=distract))


def test_light_that_changes_is_no_matter():
    def dim(picture, number):
        return np.clip(picture * (0.85 + 0.15 * math.sin(0.1 * number)), 0, 255).astype(np.uint8)

    assert_in_formation(align(spoil=dim))


def test_blocks_that_flicker_do_not_lead_astray():
    rng = np.random.default_rng(5)
    trial = align(tamper=lambda frame: [replace(frame, blocks=[b for b in frame.blocks if rng.random() > 0.15])])
    assert_in_formation(trial)


def test_a_missing_frame_is_asked_for_again():
    count = iter(range(10**9))
    trial = align(tamper=lambda frame: [] if next(count) % 7 == 3 else [frame])
    assert_in_formation(trial)


@pytest.mark.parametrize("lag", [1, 4, LOOK + 8])
def test_late_frames_do_not_count(lag):
    """Frames arrive when `lag` newer ones have been taken: the first after a move still show what was before it."""
    under_way = deque()

    def late(frame):
        under_way.append(frame)
        return [under_way.popleft()] if len(under_way) > lag else []

    trial = align(tamper=late)
    assert_in_formation(trial)
    assert "hold" not in words(trial)


def test_a_dead_camera_loses_the_neighbour():
    count = iter(range(10**9))
    trial = align(tamper=lambda frame: [] if next(count) > LOOK + 5 else [frame])
    assert trial.outcome == "lost"


# --- whole runs -----------------------------------------------------------------------------------------------------

RUN = ["fine_tuner.mode=precise", "world.camera.mode=on_demand", "world.overhead.enabled=false", "leader.timesteps=4"]


def run(tmp_path, monkeypatch, process):
    """Run with a stand-in for the detector's `process`, which takes the number of the frame and the true blocks."""
    frames = itertools.count()
    true_process = BlockDetector.process

    def changed(self, picture, stamp_us):
        return process(next(frames), true_process(self, picture, stamp_us))

    monkeypatch.setattr(BlockDetector, "process", changed)
    result = run_in_process(override(load_track("one"), RUN), tmp_path / "run", {})
    return result, analyse(load_run(result.bag))


def states(analysis_or_record):
    return [state.split(":")[0] for state in analysis_or_record.followers[0].states]


def test_a_neighbour_that_vanishes_in_a_run_is_lost_and_the_bag_is_complete(tmp_path, monkeypatch):
    result, analysis = run(tmp_path, monkeypatch, lambda number, blocks: blocks if number < 5 * LOOK else [])
    assert result.exit_code == exit_codes.LOST
    assert analysis.outcome == "lost"
    assert 1 <= analysis.followers[0].totals["timesteps_finished"] < 4
    with read_bag(result.bag) as bag:
        assert not bag.recovered


def test_a_neighbour_that_comes_back_in_a_run_is_reacquired(tmp_path, monkeypatch):
    result, analysis = run(
        tmp_path, monkeypatch, lambda number, blocks: [] if 5 * LOOK <= number < 9 * LOOK else blocks
    )
    assert result.exit_code == exit_codes.DONE
    assert "reacquired" in states(load_run(result.bag))
    assert analysis.followers[0].totals["formation_error_rmse_m"] < 0.02


def test_a_camera_that_dies_in_a_run_loses_the_neighbour_in_good_order(tmp_path, monkeypatch):
    def die(number, blocks):
        if number > 5 * LOOK:
            raise ClockError("the camera is dead")
        return blocks

    result, analysis = run(tmp_path, monkeypatch, die)
    assert result.exit_code == exit_codes.LOST
    assert analysis.outcome == "lost"
    assert any("asked for again" in warning for warning in result.warnings)
