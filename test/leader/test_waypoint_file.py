"""Waypoint files: what they mean, and what is refused."""

import math
from pathlib import Path

import pytest

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.leader_motion import LeaderParameters
from robot_formation.leader.paths import LeaderPath, make_path, poses
from robot_formation.leader.paths.waypoint_file import read_motions
from robot_formation.parameters import ParameterError


def written(folder: Path, text: str) -> Path:
    file = folder / "way.csv"
    file.write_text(text)
    return file


def made(folder: Path, text: str, *texts: str) -> LeaderPath:
    return make_path("waypoints", [f"file={written(folder, text)}", *texts])


def track(path: LeaderPath) -> list[tuple[float, float, float]]:
    assert path.timesteps is not None
    return [parts(pose) for pose in poses(path, path.timesteps)]


def parts(motion: Motion) -> tuple[float, float, float]:
    return motion.x_m, motion.y_m, motion.yaw_rad


def test_points_are_driven_one_after_another_with_the_heading_kept(tmp_path: Path) -> None:
    path = made(tmp_path, "x_m,y_m\n1,1\n1.05,1\n1.05,1.02\n")
    assert track(path) == [(0, 0, 0), pytest.approx((0.05, 0, 0)), pytest.approx((0.05, 0.02, 0))]


def test_headings_turn_the_frame_and_go_the_short_way_round(tmp_path: Path) -> None:
    path = made(tmp_path, f"x_m,y_m,yaw_rad\n0,0,{math.pi / 2}\n0,0.05,{math.pi - 0.1}\n0,0.05,{-math.pi + 0.1}\n")
    assert parts(path.motion(1)) == pytest.approx((0.05, 0.0, math.pi / 2 - 0.1))
    assert path.motion(2).yaw_rad == pytest.approx(0.2)


def test_without_headings_the_leader_can_look_along_the_way(tmp_path: Path) -> None:
    path = made(tmp_path, "x_m,y_m\n0,0\n0.05,0\n0.05,0.05\n", "heading=along")
    assert parts(path.motion(1)) == pytest.approx((0.05, 0.0, math.pi / 2))
    assert parts(path.motion(2)) == pytest.approx((0.05, 0.0, 0.0))


def test_times_are_sampled_at_every_timesteps_end(tmp_path: Path) -> None:
    path = made(tmp_path, "t_s,x_m,y_m,yaw_rad\n10,0,0,0\n11,0.1,0,0.2\n12,0.1,0.1,0.2\n", "step_s=0.5")
    assert track(path) == [
        pytest.approx(row) for row in [(0, 0, 0), (0.05, 0, 0.1), (0.1, 0, 0.2), (0.1, 0.05, 0.2), (0.1, 0.1, 0.2)]
    ]


def test_motions_are_taken_to_the_last_bit(tmp_path: Path) -> None:
    values = (0.1 + 0.2, -1.0 / 3.0, 1e-17)
    path = made(tmp_path, "dx_m,dy_m,dyaw_rad\n" + ",".join(map(repr, values)) + "\n")
    assert path.motion(1) == Motion(*values)


def test_a_file_of_crazyswarm_gives_its_polynomials(tmp_path: Path) -> None:
    header = ",".join(["duration", *(f"{axis}^{power}" for axis in ("x", "y", "z", "yaw") for power in range(8))])

    def piece(duration: float, x: list[float], y: list[float], yaw: list[float]) -> str:
        cells = [c for part in (x, y, [9.0], yaw) for c in [*part, *[0.0] * (8 - len(part))]]
        return ",".join(map(str, [duration, *cells]))

    rows = [piece(2, [0, 0.05], [0, 0, 0.01], [0]), piece(1, [0.1], [0.04, 0.02], [0, 0.1])]
    path = made(tmp_path, "\n".join([header, *rows]) + "\n")
    expected = [(0, 0, 0), (0.05, 0.01, 0), (0.1, 0.04, 0), (0.1, 0.06, 0.1)]
    assert track(path) == [pytest.approx(row) for row in expected]
    scaled = read_motions(tmp_path / "way.csv", 0.5, 0.5)
    assert len(scaled) == 6
    assert scaled[0].x_m == pytest.approx(0.0125)


def test_a_file_is_repeated_if_asked_to_be(tmp_path: Path) -> None:
    path = made(tmp_path, "x_m,y_m\n0,0\n0.05,0\n0.05,0.02\n", "at_end=repeat")
    assert path.timesteps is None
    assert path.motion(5) == path.motion(1)


def test_a_file_shorter_than_the_run_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path, "x_m,y_m\n0,0\n0.05,0\n")
    parameters = LeaderParameters(timesteps=2, path="waypoints", path_parameters=(f"file={file}",))
    with pytest.raises(
        ParameterError, match=r"has 1 timesteps, fewer than leader\.timesteps = 2; set leader\.timesteps=1"
    ):
        parameters.make_path()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no points"),
        ("x_m,y_m\n", "holds no points"),
        ("x_m,y_m\n0,0\n", "a path needs two or more"),
        ("x,y\n0,0\n1,1\n", "its first line 'x,y' names no known columns"),
        ("x_m,y_m,speed\n0,0,1\n1,1,1\n", "names no known columns"),
        ("x_m,y_m\n0,0\n0.05,\n", "line 3: 'y_m' is empty"),
        ("x_m,y_m\n0,0\n\n0.05,0\n", "line 3 has 0 values for 2 columns; fill the gap"),
        ("x_m,y_m\n0,0\nnan,0\n", "line 3: 'x_m' is nan; every value must be finite"),
        ("x_m,y_m\n0,0\n1e400,0\n", "line 3: 'x_m' is inf"),
        ("x_m,y_m\n0,0\nfar,0\n", "line 3: 'x_m' is 'far'; every value must be a number"),
        ("x_m,y_m\n0,0\n0.1\n", "line 3 has 1 values for 2 columns"),
        ("t_s,x_m,y_m\n0,0,0\n0,0.1,0\n", "line 3: 't_s' must grow"),
        ("t_s,x_m,y_m\n0,0,0\n1,0,0\n2,0,0\n3,0,0\n20,0,0\n", "a gap of 17 s before line 6"),
        ("t_s,x_m,y_m\n0,0,0\n0.1,0.1,0\n", "lasts 0.1 s, which are 0 timesteps of step_s = 1 s"),
    ],
)
def test_a_file_that_is_no_path_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ParameterError) as error:
        made(tmp_path, text)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_missing_or_no_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="can't read this path: No such file"):
        make_path("waypoints", [f"file={tmp_path / 'no.csv'}"])
    (tmp_path / "picture.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ParameterError, match="no CSV file of text"):
        make_path("waypoints", [f"file={tmp_path / 'picture.csv'}"])


def test_a_heading_along_a_way_that_stands_still_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="lines 2 and 3 are the same point"):
        made(tmp_path, "x_m,y_m\n0,0\n0,0\n0.05,0\n", "heading=along")


def test_a_part_of_a_switch_longer_than_its_file_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path, "x_m,y_m\n0,0\n0.05,0\n0.1,0\n")
    texts = [f"waypoints.file={file}"]
    assert make_path("switch", ["parts=waypoints:2 straight", *texts]).motion(2) == Motion(0.05)
    with pytest.raises(ParameterError, match="part 'waypoints:3' is longer than its 2 timesteps"):
        make_path("switch", ["parts=waypoints:3 straight", *texts])


def test_polynomials_without_a_header_are_refused_rather_than_their_first_piece_lost(tmp_path: Path) -> None:
    row = ",".join(["1.0"] + ["0.0"] * 32)
    with pytest.raises(ParameterError, match="begins with a header"):
        made(tmp_path, f"{row}\n{row}\n{row}\n")


def test_equal_times_are_no_gap(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="line 4: 't_s' must grow"):
        made(tmp_path, "t_s,x_m,y_m\n0,0,0\n1,0.05,0\n1,0.1,0\n1,0.15,0\n")
