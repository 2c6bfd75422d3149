"""Animations of recorded runs: files of the size they should have, what they show, and what is refused."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from repository import ROOT
from robot_formation.analysis.errors import AnalysisError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.reader import read_bag
from robot_formation.cli.main import main
from robot_formation.viewing.animate import animate, picture_stamps
from robot_formation.viewing.animation_figure import AnimationFigure
from robot_formation.viewing.animation_file import AnimationError, write_mp4
from robot_formation.viewing.recorded_scene import RecordedScene
from robot_formation.viewing.replayed_camera import ReplayedCamera

pytestmark = pytest.mark.xdist_group("animate")

SAMPLE = ROOT / "bags" / "samples" / "track_two_formation"
PICTURES = ROOT / "bags" / "samples" / "pictures"
SECOND = 10**9


@pytest.fixture(scope="module")
def sample() -> Iterator[FormationBag]:
    with read_bag(SAMPLE) as bag:
        yield FormationBag(bag)


@pytest.fixture(scope="module")
def scene(sample: FormationBag) -> RecordedScene:
    return RecordedScene(sample, "follower_1")


@pytest.fixture(scope="module")
def figure(sample: FormationBag, scene: RecordedScene) -> AnimationFigure:
    return AnimationFigure(scene, ReplayedCamera(sample, "follower_1"), 800)


def test_the_gif_of_a_sample_has_its_pictures_and_is_small(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run.gif"
    assert main(["animate", str(SAMPLE), "--out", str(out), "--every", "4", "--fps", "8", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    with Image.open(out) as image:
        frames = image.n_frames  # type: ignore[attr-defined]
        durations = []
        for number in range(frames):
            image.seek(number)
            durations.append(image.info["duration"])
        assert image.size == (800, 680)
    assert frames == told["pictures"] == 1 + 13 + 1  # 53.77 s: the start, every 4 s, the end
    assert durations == [120] * (frames - 1) + [2000]
    assert told["rendered"]
    assert told["size_bytes"] == out.stat().st_size < 250_000
    assert os.listdir(tmp_path) == ["run.gif"]


def test_by_default_there_are_up_to_150_pictures() -> None:
    assert len(picture_stamps(0, int(53.77 * SECOND), None)) == 136
    assert len(picture_stamps(0, 15 * SECOND, None)) == 151
    assert 100 < len(picture_stamps(0, 5000 * SECOND, None)) <= 151
    assert picture_stamps(5, 5, None) == [5]
    with pytest.raises(AnimationError, match=r"makes 5001 of them; at most 2000 .* --every 0.3 or more"):
        picture_stamps(0, 500 * SECOND, 0.1)


def test_a_png_is_one_picture_of_the_end(tmp_path: Path, figure: AnimationFigure, scene: RecordedScene) -> None:
    made = animate(SAMPLE, tmp_path / "end.png", "follower_1")
    assert made.pictures == 1
    with Image.open(made.path) as image:
        assert np.array_equal(np.asarray(image), figure.picture(scene.end_ns))


def test_pictures_are_of_the_width_asked_for_made_even(tmp_path: Path) -> None:
    made = animate(PICTURES, tmp_path / "small.png", "follower_1", width_px=399)
    assert made.size == (400, 340)
    assert not made.rendered
    with Image.open(made.path) as image:
        assert image.size == made.size


def test_a_picture_depends_on_its_time_only(figure: AnimationFigure) -> None:
    first = figure.picture(10 * SECOND)
    assert not np.array_equal(figure.picture(30 * SECOND), first)
    assert np.array_equal(figure.picture(10 * SECOND), first)


def test_the_scene_at_the_end_has_the_figures_of_the_analysis(scene: RecordedScene) -> None:
    for timestep in scene.quantities.timesteps:
        done = scene.corrections(timestep.t, scene.end_ns)
        assert done == pytest.approx((timestep.corrections.u_m, timestep.corrections.v_m))
        assert scene.error_m(timestep.t, scene.end_ns) == timestep.formation_error_m
    assert scene.finished(scene.end_ns) == 20
    off_place = scene.off_place_uv_m(scene.at("follower_1", scene.end_ns), scene.end_ns)
    assert off_place == pytest.approx(scene.quantities.timesteps[-1].error_uv_m)


def test_corrections_and_errors_grow_with_time(scene: RecordedScene) -> None:
    corrected = [scene.corrections(1, int(s * SECOND)) for s in (3.0, 4.2, 5.4)]  # before, between and after both moves
    assert corrected[0] == (0.0, 0.0)
    assert corrected[1] == pytest.approx((0.01659, 0.00561), abs=1e-5)
    assert corrected[2] == pytest.approx((0.01659 + 0.00102, 0.00561 + 0.00635), abs=1e-5)
    assert [scene.error_m(1, int(s * SECOND)) is None for s in (5.6, 5.64)] == [True, False]


def test_the_forecast_is_that_of_the_timestep_under_way(scene: RecordedScene) -> None:
    record = scene.record.followers[0]
    begins, ends = (record.displacements[k].stamp_ns for k in (7, 8))
    forecast = scene.forecast(ends - 1)
    assert forecast is not None
    local = forecast.place.relative_to(scene.at("follower_1", begins))
    assert local.uv_m == pytest.approx(record.predictions[7].motion.uv_m)
    assert scene.forecast(record.displacements[0].stamp_ns - 1) is None
    assert scene.forecast(scene.end_ns) is None  # there is no timestep 21


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (1.5, "leader moves"),
        (2.2, "follower 1 moves: collect"),
        (3.0, "follower 1 looks"),
        (3.5, "follower 1 moves: correct: fine-tune u"),
        (99.0, "end of the run: done"),
    ],
)
def test_words_say_who_does_what(figure: AnimationFigure, scene: RecordedScene, second: float, words: str) -> None:
    assert scene.words(int(second * SECOND), looks=True) == words


def test_blocks_are_drawn_where_they_were_found(figure: AnimationFigure) -> None:
    looking, moving = (figure.picture(int(s * SECOND)) for s in (3.0, 3.5))
    assert white_outlines(looking) > 150 > 20 > white_outlines(moving)


def white_outlines(picture: NDArray[np.uint8]) -> int:
    """Pixels of pure white in the camera's picture beside pixels of pure black: outlines with their halo."""
    view = picture[55:270, 440:780]
    white, black = np.all(view == 255, axis=2), np.all(view == 0, axis=2)
    near = np.zeros_like(black)
    for rows, columns in ((2, 0), (-2, 0), (0, 2), (0, -2)):
        near |= np.roll(black, (rows, columns), (0, 1))
    return int((white & near).sum())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nobag"], "nobag doesn't exist"),
        ([str(SAMPLE), "--out", "run.webm"], "'run.webm' is no animation: end its name with .gif, .mp4, .png"),
        ([str(SAMPLE), "--out", "no/folder/run.gif"], "can't be written: No such file or directory"),
        ([str(SAMPLE), "--out", "/proc/run.gif"], "can't be written"),
        ([str(SAMPLE), "--follower", "folower_1"], "has no follower 'folower_1'; did you mean 'follower_1'?"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["animate", *arguments]) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("\n") == 1
    assert not SAMPLE.with_name(f"{SAMPLE.name}_analysis").exists()


def test_a_bag_without_ground_truth_is_refused(sample: FormationBag, monkeypatch: pytest.MonkeyPatch) -> None:
    there = {name: kind for name, kind in sample.topics.items() if not name.startswith("/ground_truth")}
    monkeypatch.setattr(FormationBag, "topics", there)
    with pytest.raises(AnalysisError, match=r"has no ground truth of leader: no topic '/ground_truth/leader/odom'"):
        RecordedScene(sample, "follower_1")


def test_without_ffmpeg_a_film_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(AnimationError, match=r"an MP4 needs the program ffmpeg.*write a .gif instead"):
        animate(SAMPLE, tmp_path / "run.mp4", "follower_1")


def test_a_failing_ffmpeg_is_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho 'Unknown encoder' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    pictures = [np.zeros((200, 300, 3), np.uint8)] * 10
    with pytest.raises(AnimationError, match=r"ffmpeg can't write .*: Unknown encoder; write a .gif instead"):
        write_mp4(tmp_path / "run.mp4", pictures, (300, 200), 10.0)
    assert os.listdir(tmp_path) == ["ffmpeg"]


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_a_film_is_written(tmp_path: Path) -> None:
    assert animate(PICTURES, tmp_path / "run.mp4", "follower_1", every_s=0.5, width_px=400).pictures == 8
    assert (tmp_path / "run.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize("name", ["run.gif", "run.mp4"])
def test_an_interrupt_leaves_the_older_file_and_no_half_one(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "bin" / "ffmpeg"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\nexec cat > /dev/null\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    (tmp_path / name).write_text("older")
    drawn = AnimationFigure.picture
    count = 0

    def interrupted(figure: AnimationFigure, stamp_ns: int) -> NDArray[np.uint8]:
        nonlocal count
        count += 1
        if count > 7:
            raise KeyboardInterrupt
        return drawn(figure, stamp_ns)

    monkeypatch.setattr(AnimationFigure, "picture", interrupted)
    with pytest.raises(KeyboardInterrupt):
        animate(PICTURES, tmp_path / name, "follower_1", every_s=0.2, width_px=400)
    assert sorted(os.listdir(tmp_path)) == ["bin", name]
    assert (tmp_path / name).read_text() == "older"


def test_no_ros_is_needed() -> None:
    words = "import robot_formation.viewing.animate, sys; print({'rclpy', 'std_msgs'} & sys.modules.keys())"
    found = subprocess.run([sys.executable, "-c", words], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout == "set()\n"
