"""`formation predict` as a person types it."""

import json
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from _pytest.capture import CaptureResult

import cli_tools
from robot_formation.analysis.displacement_log import read_log
from robot_formation.analysis.from_bag import load_displacements, load_run
from robot_formation.bag.writer import BagWriter
from robot_formation.cli.main import main
from robot_formation.koopman.predictors import NAMES, Predictor, PredictorParameters
from synthetic_bag import POSE_COVARIANCE, Step, SyntheticRun, pose_with_covariance

ERRORS = ["n", "rmse_u", "rmse_v", "rmse", "median", "worst", "coverage_90"]
OF_MODEL = {"k", "condition_number", "eigenvalues", "consistency_index", "weights"}
STEPS = [
    Step(moved=(0.010, 0.050), residual=(0.001, 0.002)),
    Step(moved=(0.012, 0.051), residual=(-0.001, 0.0)),
    Step(moved=(0.011, 0.048), residual=(0.0, 0.001)),
    Step(moved=(0.009, 0.052), residual=(0.002, -0.003)),
]
COMMANDED = [(0.020, 0.040), (0.021, 0.041), (0.022, 0.042), (0.023, 0.043)]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    rng = np.random.default_rng(3)
    rows = np.hstack([rng.normal([0.0, 0.05], 0.003, (12, 2)), rng.normal(0.0, 0.002, (12, 2))])
    path = tmp_path / "log.csv"
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    path.write_text("\n".join(["u_m,v_m,residual_u_m,residual_v_m", *lines, ""]))
    return path


def write_bag(path: Path, *, commanded: bool = True, followers: int = 1, unseen: Collection[int] = ()) -> Path:
    with BagWriter(path) as writer:
        run = SyntheticRun(writer, followers)
        if commanded:
            run.topic("/follower_1/commanded", POSE_COVARIANCE)
        for number, (step, (u, v)) in enumerate(zip(STEPS, COMMANDED, strict=True)):
            run.step(step)
            if commanded:
                message = pose_with_covariance(run.now, v, -u)
                if number in unseen:
                    message.pose.covariance[0] = -1.0
                run.send("/follower_1/commanded", message)
    return path


def predict(capsys: pytest.CaptureFixture[str], *arguments: object) -> CaptureResult[str]:
    assert main(["predict", *map(str, arguments)]) == 0
    return capsys.readouterr()


def forecasts(capsys: pytest.CaptureFixture[str], *arguments: object) -> Any:
    said = predict(capsys, *arguments, "--json")
    return json.loads(said.out)["predictors"]


def complaint(capsys: pytest.CaptureFixture[str], *arguments: Path | str) -> str:
    return cli_tools.complaint(capsys, "predict", *arguments)


def test_json_holds_forecast_covariance_and_errors_of_each_predictor_and_nothing_else(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path
) -> None:
    said = predict(capsys, log, "--json")
    assert said.err == ""
    found = json.loads(said.out)
    assert list(found) == ["predictors", "best"]
    rmse = {name: values["error_m"]["rmse"] for name, values in found["predictors"].items()}
    assert found["best"] == min(rmse, key=lambda name: rmse[name])
    assert list(found["predictors"]) == list(NAMES)
    for values in found["predictors"].values():
        assert list(values)[:3] == ["forecast", "covariance", "error_m"]
        assert set(values) - {"forecast", "covariance", "error_m"} == OF_MODEL
        assert values["forecast"][0] is None
        assert values["covariance"][0] is None
        assert np.array(values["forecast"][1:]).shape == (11, 2)
        covariances = np.array(values["covariance"][1:])
        assert covariances.shape == (11, 2, 2)
        assert (np.linalg.eigvalsh(covariances) > 0.0).all()
        assert list(values["error_m"]) == ERRORS
        assert values["error_m"]["n"] == 11
    assert list(tmp_path.iterdir()) == [log]


@pytest.mark.parametrize("name", NAMES)
def test_a_forecast_is_that_of_a_predictor_that_saw_the_rows_before(
    capsys: pytest.CaptureFixture[str], log: Path, name: str
) -> None:
    found = forecasts(capsys, log, "--predictor", name)[name]
    rows = read_log(log)
    predictor = Predictor(PredictorParameters(name=name))
    for t in range(12):
        if t:
            expected = predictor.predict()
            assert found["forecast"][t] == expected.mean[:2].tolist()
            assert found["covariance"][t] == expected.covariance[:2, :2].tolist()
        predictor.observe(np.append(rows.displacements_m[t], 0.0), np.append(rows.residuals_m[t], 0.0))
    errors = rows.targets_m[1:] - np.array(found["forecast"][1:])
    assert found["error_m"]["rmse"] == pytest.approx(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def test_predictors_come_in_the_order_named_once_each(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    options = ("--predictor", "ewma+close", "--predictor", "previous", "--predictor", "ewma+close")
    assert list(forecasts(capsys, log, *options)) == ["ewma+close", "previous"]


def test_predictor_is_an_option_and_no_abbreviation_that_another_option_could_take(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    assert "argument --predictor: takes one or several" in complaint(capsys, log, "--predictor", ",")
    assert list(forecasts(capsys, log, "--predictor", "ewma", "--predictors", "previous")) == ["ewma", "previous"]


@pytest.mark.parametrize("option", ["--predictors", "--predictor"])
def test_predictors_may_be_listed_with_commas(capsys: pytest.CaptureFixture[str], log: Path, option: str) -> None:
    assert list(forecasts(capsys, log, option, "ewma+close,previous", option, "previous,literal")) == [
        "ewma+close",
        "previous",
        "literal",
    ]


def test_parameters_are_those_of_run(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    plain = forecasts(capsys, log, "--predictor", "ewma")["ewma"]
    last = forecasts(capsys, log, "--predictor", "ewma", "--set", "predictor.ewma.gain=1")["ewma"]
    previous = forecasts(capsys, log, "--predictor", "previous")["previous"]
    np.testing.assert_allclose(last["forecast"][1:], previous["forecast"][1:], rtol=0, atol=1e-15)
    assert plain["forecast"][2] != pytest.approx(previous["forecast"][2])


def test_a_single_row_has_no_forecast_and_no_errors(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("u_m,v_m\n0.01,0.05\n")
    found = forecasts(capsys, path, "--predictor", "measured")["measured"]
    nothing = {"forecast": [None], "covariance": [None], "error_m": {**dict.fromkeys(ERRORS), "n": 0}}
    assert found == {**nothing, **dict.fromkeys(OF_MODEL)}
    said = predict(capsys, path)
    assert next(line for line in said.out.splitlines() if line.startswith("measured")).split()[1:] == ["0", *["-"] * 6]
    assert (tmp_path / "log_forecasts.png").stat().st_size > 5000


def test_the_table_and_a_picture_beside_the_log_are_made(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    said = predict(capsys, log)
    assert said.err == ""
    lines = said.out.splitlines()
    assert lines[0].startswith(f"{log}: 12 timesteps")
    assert "ideal move" in lines[0]
    rows = {line.split()[0]: line.split()[1:] for line in lines if line.split()[:1] and line.split()[0] in NAMES}
    assert list(rows) == list(NAMES)
    errors = forecasts(capsys, log)
    for name, cells in rows.items():
        assert cells[:2] == ["11", f"{errors[name]['error_m']['rmse_u'] * 1e3:.2f}"]
    assert max(map(len, lines[1:-1])) <= 100
    picture = log.with_name("log_forecasts.png")
    assert lines[-1] == f"picture: {picture}"
    pixels = matplotlib.image.imread(picture)
    assert pixels.shape[1] > 1500
    assert pixels[..., :3].std() > 0.05


@pytest.mark.parametrize("names", [["previous"], ["literal", "ewma"], list(NAMES)])
def test_a_picture_goes_where_it_is_told(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path, names: list[str]
) -> None:
    options = [word for name in names for word in ("--predictor", name)]
    for suffix in (".png", ".svg"):
        picture = tmp_path / f"picture{suffix}"
        forecasts(capsys, log, *options, "--figure", picture)
        assert picture.stat().st_size > 5000
    assert not log.with_name("log_forecasts.png").exists()


def test_no_figure_draws_none_and_loads_neither_matplotlib_nor_ros(log: Path) -> None:
    program = (
        f"import sys; from robot_formation.cli.main import main; main(['predict', {str(log)!r}, '--no-figure']); "
        "print([m for m in ('matplotlib', 'rclpy', 'geometry_msgs', 'pybullet', 'rosbags') if m in sys.modules], "
        "file=sys.stderr)"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stderr == "[]\n"
    assert list(log.parent.iterdir()) == [log]


def test_displacements_beyond_the_bounds_of_forecasts_are_warned_of(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text("u_m,v_m\n0.0,0.5\n0.0,0.5\n0.0,0.1\n")
    said = predict(capsys, path, "--json", "--predictor", "previous")
    assert "warning: 2 displacement(s)" in said.err
    assert json.loads(said.out)["predictors"]["previous"]["forecast"][1] == [0.0, 0.2]
    said = predict(capsys, path, "--json", "--predictor", "previous", "--set", "predictor.max_v_m=1")
    assert said.err == ""
    assert json.loads(said.out)["predictors"]["previous"]["forecast"][1] == [0.0, 0.5]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--predictor", "mesured"], ["--predictors: no predictor 'mesured'", "did you mean 'measured'"]),
        (["--set", "predictor.forgeting=0.9"], ["'forgeting'", "'forgetting'"]),
        (["--set", "predictor.forgetting=2"], ["forgetting", "outside"]),
        (["--set", "predicter.forgetting=0.9"], ["'predicter'", "'predictor'"]),
        (["--set", "predictor.name=ewma"], ["name predictors by --predictors"]),
        (["--set", "seed=3"], ["seed=3", "predictor."]),
        (["--set", "leader.timesteps=3"], ["leader.timesteps", "predictor."]),
        (["--set", "predictor.forgetting"], ["KEY=VALUE"]),
        (["--figure", "picture.csv"], ["picture.csv", ".png"]),
        (["--figure", "/nowhere/picture.png"], ["/nowhere/picture.png", "can't be written"]),
        (["--figure", "a.png", "--no-figure"], ["not allowed with"]),
        (["--robot", "follower_1"], ["--robot", "--bag"]),
        (["--out", "other.csv"], ["--out", "--bag"]),
        (["--bag", "bag"], ["not allowed with"]),
    ],
)
def test_a_mistake_is_one_line_with_a_hint_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], log: Path, options: list[str], words: list[str]
) -> None:
    line = complaint(capsys, log, *options)
    for word in words:
        assert word in line


def test_a_bad_row_is_named_by_file_and_line(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    log.write_text(log.read_text() + "0.01,0.05,here,0.0\n")
    line = complaint(capsys, log, "--json")
    assert f"{log}, line 14: residual_u_m is 'here'" in line
    log.write_text("u_m,v_m\n0.01,0.05\n\n0.01,1e6\n")
    line = complaint(capsys, log)
    assert f"{log}, line 4: refused the displacement" in line


def test_a_log_or_a_bag_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert "required" in complaint(capsys)


def test_a_bags_log_has_its_displacements_residuals_and_commands(tmp_path: Path) -> None:
    log = load_displacements(write_bag(tmp_path / "bag", unseen=[2]), "follower_1")
    np.testing.assert_array_equal(log.displacements_m, [step.moved for step in STEPS])
    np.testing.assert_array_equal(log.residuals_m, [step.residual for step in STEPS])
    np.testing.assert_array_equal(log.commanded_m, [*COMMANDED[:2], (np.nan, np.nan), COMMANDED[3]])
    assert log.places[0] == "timestep 1"


def test_a_bag_forecasts_like_the_log_written_from_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", unseen=[1])
    written = tmp_path / "written.csv"
    by_bag = forecasts(capsys, "--bag", bag, "--out", written)
    assert by_bag == forecasts(capsys, written)
    assert "exists already" in complaint(capsys, "--bag", bag, "--out", written)


def test_a_bag_without_commands_is_read_and_its_picture_lies_with_those_of_the_analysis(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "bag", commanded=False)
    said = predict(capsys, "--bag", bag)
    assert "4 timesteps, without commands" in said.out
    assert (tmp_path / "bag_analysis" / "forecasts.png").stat().st_size > 5000


def test_another_follower_and_one_that_is_not_there(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", followers=2)
    assert forecasts(capsys, "--bag", bag, "--robot", "follower_2", "--predictor", "previous")
    line = complaint(capsys, "--bag", bag, "--robot", "folower_2")
    assert "'folower_2'" in line
    assert "did you mean 'follower_2'" in line
    assert "missing" in complaint(capsys, "--bag", tmp_path / "missing")
    assert "is not a bag" in complaint(capsys, "--bag", __file__)


def test_a_bag_without_displacements_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        SyntheticRun(writer)
    assert "no displacements" in complaint(capsys, "--bag", tmp_path / "bag")


def test_forecasts_of_a_runs_bag_are_what_its_predictor_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    options = ["--in-process", "--camera", "on_demand", "--set", "leader.timesteps=5", "--predictor", "measured"]
    assert main(["run", "--seed", "3", "--bag", str(bag), "--json", *options]) == 0
    capsys.readouterr()
    said = [(entry.motion.u_m, entry.motion.v_m) for entry in load_run(bag).followers[0].predictions]
    found = forecasts(capsys, "--bag", bag, "--predictor", "measured")["measured"]["forecast"]
    np.testing.assert_allclose(found[1:], said[:4], rtol=0, atol=1e-12)


# --- logs of one's own ----------------------------------------------------------------------------------------------


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """A log in millimetres with names of its own: a sine sideways, a turn, and two bad rows."""
    rows = [f"{20.0 * np.cos(0.45 * t):.3f},30.0,{0.01:.2f}" for t in range(40)]
    rows[20], rows[30] = "x,30.0,0.0", "90000.0,30.0,0.0"
    path = tmp_path / "own.csv"
    path.write_text("\n".join(["dx,dy,yaw", *rows, ""]))
    return path


OWN = ("--columns", "u_m=dx,v_m=dy,turn_rad=yaw", "--unit", "mm")


def test_a_log_with_other_names_and_units_is_read_and_bad_rows_are_left_out_and_counted(
    capsys: pytest.CaptureFixture[str], foreign: Path
) -> None:
    said = predict(capsys, foreign, *OWN, "--skip-bad", "--json", "--predictors", "previous,formation")
    found = json.loads(said.out)
    assert len(found["predictors"]["previous"]["forecast"]) == 38
    assert found["predictors"]["previous"]["forecast"][1] == pytest.approx([0.020, 0.030])
    assert found["best"] == "formation"
    assert "2 bad row(s) left out; the first" in said.err
    assert "line 22: u_m is 'x'" in said.err
    assert "line 22: u_m is 'x', which is no number" in complaint(capsys, foreign, *OWN)


def test_the_horizon_judges_the_ways_of_several_timesteps(capsys: pytest.CaptureFixture[str], foreign: Path) -> None:
    options = (*OWN, "--skip-bad", "--horizon", "3", "--predictors", "previous,formation")
    found = forecasts(capsys, foreign, *options)
    for values in found.values():
        assert [row["h"] for row in values["horizon"]] == [1, 2, 3]
        assert [row["n"] for row in values["horizon"]] == [37, 36, 35]
        assert values["horizon"][0]["rmse"] == pytest.approx(values["error_m"]["rmse"])
    assert found["formation"]["horizon"][2]["rmse"] < 0.6 * found["previous"]["horizon"][2]["rmse"]
    table = predict(capsys, foreign, *options, "--no-figure").out
    assert "formation" in next(line for line in table.splitlines() if line.endswith("<- least RMSE"))
    assert "h = 3" in table


def test_k_with_eigenvalues_and_their_periods_is_told_where_there_is_one(
    capsys: pytest.CaptureFixture[str], foreign: Path
) -> None:
    found = forecasts(capsys, foreign, *OWN, "--skip-bad", "--predictors", "previous,formation,measured")
    assert {found["previous"][key] for key in OF_MODEL} == {None}
    assert np.array(found["measured"]["k"]).shape == (2, 2)
    eigenvalues = found["formation"]["eigenvalues"]
    assert any(row["period"] == pytest.approx(2.0 * np.pi / 0.45, rel=0.1) for row in eigenvalues if row["period"])
    assert sum(found["formation"]["weights"]["v"].values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--columns", "u_m"), "is no NAME=COLUMN"),
        (("--columns", "w_m=dx"), "no 'w_m' in a log"),
        (("--columns", "u_m=dx,v_m=dx"), "names what is named already"),
        (("--columns", "u_m=dz"), "no column 'dz' in the header"),
        (("--horizon", "0"), "no number of timesteps from 1 to 50"),
        (("--unit", "km"), "can't be 'km'"),
    ],
)
def test_wrong_options_for_logs_of_ones_own_are_refused_in_a_line(
    capsys: pytest.CaptureFixture[str], foreign: Path, options: tuple[str, ...], said: str
) -> None:
    assert said in complaint(capsys, foreign, *options)


def test_with_turns_the_table_judges_the_same_moves_as_the_row_of_horizon_1(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    random = np.random.default_rng(3)
    file = tmp_path / "turning.csv"
    rows = np.column_stack(
        [0.002 * random.standard_normal(30), 0.05 + 0.002 * random.standard_normal(30), np.full(30, 0.3)]
        + [0.01 * random.standard_normal(30) for _ in range(2)]
    )
    header = "u_m,v_m,turn_rad,residual_u_m,residual_v_m"
    np.savetxt(file, rows, delimiter=",", header=header, comments="")
    found = forecasts(capsys, file, "--horizon", "1", "--predictors", "previous,formation")
    for values in found.values():
        assert values["horizon"][0]["rmse"] == pytest.approx(values["error_m"]["rmse"])
