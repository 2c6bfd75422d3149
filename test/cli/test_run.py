"""`formation run` and its relatives as a person types them: exit codes, one-line errors, nothing overwritten."""

import json
import sys
from pathlib import Path

import pytest

from cli_tools import complaint
from graph_tools import formation, json_of
from robot_formation.bag.errors import BagError
from robot_formation.bag.reader import read_bag
from robot_formation.cli.main import main

pytestmark = pytest.mark.slow

FAST = ("--camera", "on_demand", "--in-process")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "--track", "tow"), ["no track 'tow'", "'two'"]),
        (("run", "--predictor", "mesured"), ["--predictor can't be 'mesured'", "'measured'"]),
        (("run", "--surface", "bowel"), ["no surface 'bowel'", "'bowl'"]),
        (("run", "--camera", "streem"), ["'streem'", "'stream'"]),
        (("run", "--set", "predictor.forgeting=0.9"), ["'forgeting'", "'forgetting'"]),
        (("run", "--set", "predicter.forgetting=0.9"), ["'predicter'", "'predictor'"]),
        (("run", "--set", "predictor.forgetting=2"), ["forgetting", "outside 0.01 to 1.0"]),
        (("run", "--set", "predictor.forgetting=often"), ["forgetting", "float"]),
        (("run", "--set", "leader.timesteps"), ["KEY=VALUE"]),
        (("run", "--set", "sed=3"), ["'sed'", "'seed'"]),
        (("run", "--set", "world.camera.min_frames_per_second=31"), ["min_frames_per_second", "240"]),
        (("run", "--set", "world.surface_parameters=[depth=1]"), ["depth"]),
        (("run", "--seed", "-1"), ["seed"]),
        (("run", "--without", "block_detektor"), ["--without", "'block_detektor'", "did you mean 'block_detector'"]),
        (
            ("run", "--without", "follower_2/drive"),
            ["--without", "'follower_2/drive'", "did you mean 'follower_1/drive'"],
        ),
        (("run", "--without", "predictor", "--in-process"), ["--without", "--in-process"]),
        (("run", "--stand-in-timeout", "3"), ["--stand-in-timeout", "--without"]),
        (("run", "--without", "world", "--stand-in-timeout", "0"), ["--stand-in-timeout", "'0'", "above 0"]),
        (("run", "--max-size", "0"), ["--max-size", "'0'", "above 0"]),
        (("run", "--max-duration", "long"), ["--max-duration", "'long'"]),
        (("run", "--real-time-factor", "-1"), ["--real-time-factor", "outside"]),
        (("run", "--track", "one", "--scenario", "x.yaml"), ["not allowed with"]),
        (("run", "--scenario", "missing.yaml"), ["missing.yaml", "No such file"]),
        (("rnu",), ["no verb 'rnu'", "'run'"]),
        (("analyze", "missing_bag"), ["missing_bag"]),
        (("analyze", __file__), ["bag"]),
    ],
)
def test_a_mistake_is_one_line_with_a_hint_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: list[str]
) -> None:
    line = complaint(capsys, *arguments)
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("leader: {timestep: 3}", ["'timestep'", "'timesteps'"]),
        ("leeder: {timesteps: 3}", ["'leeder'", "'leader'"]),
        ("leader: 3", ["leader"]),
        ("[1, 2]", ["mapping"]),
        ("a: [1", ["YAML", "line"]),
        ("seed: !!python/object/apply:os.system ['true']", ["YAML"]),
    ],
)
def test_a_bad_scenario_file_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, words: list[str]
) -> None:
    file = tmp_path / "scenario.yaml"
    file.write_text(text)
    line = complaint(capsys, "run", "--scenario", file)
    for word in [*words, str(file)]:
        assert word in line


def test_nothing_is_overwritten(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "precious").write_text("data")
    assert "exists already" in complaint(capsys, "run", "--bag", bag)
    assert (bag / "precious").read_text() == "data"
    (tmp_path / "other.partial").mkdir()
    assert "exists already" in complaint(capsys, "run", "--bag", tmp_path / "other", "--in-process")


def test_a_bag_that_cannot_be_written_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert "file" in complaint(capsys, "run", "--in-process", "--bag", tmp_path / "file" / "bag")


@pytest.mark.parametrize(
    ("track", "predictor"),
    [
        ("one", "previous"),
        ("two", "literal"),
        ("two", "measured"),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in (("one", "literal"), ("one", "measured"), ("two", "previous"))
        ),
    ],
)
def test_every_track_and_predictor_ends_with_a_documented_code_and_a_whole_bag(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, track: str, predictor: str
) -> None:
    bag = tmp_path / "bag"
    words = ["run", "--track", track, "--predictor", predictor, "--seed", "3", "--bag", str(bag), "--json", *FAST]
    code = main(words)
    said = capsys.readouterr()
    assert code in (0, 3), said.err
    run = json.loads(said.out)
    assert run["outcome"] == ("done" if code == 0 else "lost")
    if code == 0:
        assert [row["t"] for row in run["timesteps"]] == list(range(1, (15 if track == "one" else 20) + 1))
    assert (bag / "metadata.yaml").is_file()
    assert main(["analyze", str(bag), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (run["conditions"].pop("in_process"), found["conditions"].pop("in_process")) == (True, None)
    assert (run.pop("reason") is None) == (code == 0)
    assert found.pop("reason") is None
    assert found == run
    assert (run["bag"], run["pictures"], run["seed"]) == (str(bag), [], 3)
    assert (run["predictor"], run["surface"]) == (predictor, "bowl")
    assert run["conditions"] == {
        "mode": "precise",
        "camera": "on_demand",
        "marker": "colours",
        "followers": 1,
        "drive_mode": "pwm_stop",
    }


@pytest.mark.graph
@pytest.mark.xdist_group("cli_run")
def test_a_run_through_the_graph_prints_json_only_and_its_bag_is_complete(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    bag = tmp_path / "bag"
    options = ("--camera", "on_demand", "--set", "leader.timesteps=3", "--json")
    completed = formation("run", "--bag", bag, *options)
    assert completed.returncode == 0, completed.stderr
    assert len(json_of(completed)["timesteps"]) == 3
    assert "timestep  3/3" in completed.stderr
    with (bag / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert reader.get_header().profile == "ros2"
        assert all(schema.encoding == "ros2msg" and schema.data for schema in summary.schemas.values())
        by_mcap = sum(1 for _ in reader.iter_messages())
    with read_bag(bag) as opened:
        assert by_mcap == opened.message_count
        # rosbags decodes each of them: it is stricter about the end of a message than ROS itself.
        assert sum(1 for _ in opened.messages(opened.topics)) == opened.message_count
        assert "/follower_1/blocks" in opened.topics
        assert "/follower_1/camera/image_raw" not in opened.topics
        assert opened.metadata("robot_formation")["predictor"] == "formation"


@pytest.mark.parametrize("where", ["process", pytest.param("graph", marks=[pytest.mark.graph, pytest.mark.long])])
@pytest.mark.xdist_group("cli_run")
def test_a_split_bag_is_the_same_run_in_several_files(tmp_path: Path, where: str) -> None:
    options = ["--camera", "on_demand", "--set", "leader.timesteps=4", "--json"]
    options += ["--in-process"] if where == "process" else []
    found = []
    for name, split in (("whole", ()), ("split", ("--max-duration", "10"))):
        completed = formation("run", "--bag", tmp_path / name, *options, *split)
        assert completed.returncode == 0, completed.stderr
        found.append(json_of(completed))
        assert found[-1].pop("bag") == str(tmp_path / name)
    assert found[0] == found[1]
    files = sorted(path.name for path in (tmp_path / "split").glob("*.mcap"))
    assert files[:2] == ["split_0.mcap", "split_1.mcap"]
    assert len(list((tmp_path / "whole").glob("*.mcap"))) == 1
    with read_bag(tmp_path / "split") as split_bag, read_bag(tmp_path / "whole") as whole_bag:
        assert set(split_bag.topics) == set(whole_bag.topics)
        for topic in ("/follower_1/blocks", "/follower_1/moved", "/ground_truth/leader/odom"):
            one, other = ([str(m.message) for m in bag.messages([topic])] for bag in (split_bag, whole_bag))
            assert one == other


@pytest.mark.graph
@pytest.mark.xdist_group("cli_run")
def test_images_are_recorded_on_request(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    options = ("--camera", "on_demand", "--set", "leader.timesteps=1", "--images", "--json")
    assert formation("run", "--bag", bag, *options).returncode == 0
    with read_bag(bag) as opened:
        counts = {
            topic: len(list(opened.messages([topic])))
            for topic in ("/follower_1/camera/image_raw", "/follower_1/blocks")
        }
    assert counts["/follower_1/camera/image_raw"] == counts["/follower_1/blocks"] > 0


def test_without_json_the_table_and_the_pictures_are_there(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    completed = formation("run", "--bag", bag, "--set", "leader.timesteps=4", *FAST)
    assert completed.returncode == 0, completed.stderr
    assert "outcome: done" in completed.stdout
    assert {path.name for path in (tmp_path / "bag_analysis").iterdir()} == {
        "trajectory.png",
        "corrections.png",
        "formation_error.png",
        "eigenvalues.png",
    }


def test_list_names_what_run_takes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"one", "two"} <= set(found["tracks"])
    assert {"bowl", "plane"} <= set(found["surfaces"])
    assert {"previous", "literal", "measured"} <= set(found["predictors"])
    assert main(["list", "predictors"]) == 0
    assert "measured" in capsys.readouterr().out


def test_a_closed_pipe_is_no_error(tmp_path: Path) -> None:
    import subprocess

    command = [sys.executable, "-m", "robot_formation.cli", "list"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        errors = process.stderr.read()
        process.wait()
    assert b"Traceback" not in errors


def test_json_of_a_run_that_left_nothing_to_analyse_says_what_it_was_to_be_and_why_it_ended(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robot_formation.cli import run
    from robot_formation.experiment.run_result import RunResult

    monkeypatch.setattr(run, "execute", lambda args, scenario, bag: RunResult(4, None, "world died"))
    options = ("--seed", "5", "--surface", "plane", "--set", "followers=2", "--track", "one")
    assert main(["run", "--json", "--bag", str(tmp_path / "bag"), *options]) == 4
    said = capsys.readouterr()
    assert said.err == "formation run: world died\n"
    assert json.loads(said.out) == {
        "scenario": "track_one",
        "outcome": "incomplete",
        "timesteps": [],
        "totals": None,
        "seed": 5,
        "predictor": "formation",
        "path": "straight",
        "surface": "plane",
        "conditions": {
            "mode": "precise",
            "camera": "stream",
            "marker": "colours",
            "followers": 2,
            "drive_mode": "pwm_stop",
            "in_process": False,
        },
        "bag": None,
        "pictures": [],
        "reason": "world died",
    }


def test_a_run_that_left_nothing_to_analyse_names_its_bag(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robot_formation.cli import run
    from robot_formation.experiment.run_result import RunResult

    def refuse(args: object, result: object) -> None:
        raise BagError("no timestep")

    bag = tmp_path / "bag"
    monkeypatch.setattr(run, "execute", lambda args, scenario, place: RunResult(130, bag, "interrupted"))
    monkeypatch.setattr(run, "report", refuse)
    assert main(["run", "--bag", str(bag)]) == 130
    said = capsys.readouterr()
    assert said.out == f"bag: {bag}\n"
    assert said.err.splitlines() == ["formation run: interrupted", "formation run: no analysis: no timestep"]


def test_the_table_names_the_conditions_of_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = tmp_path / "bag"
    options = ("--set", "leader.timesteps=1", "--set", "fine_tuner.mode=paper", "--set", "world.motor.drive_mode=pid")
    assert main(["run", "--bag", str(bag), *options, *FAST]) == 0
    assert capsys.readouterr().out.splitlines()[0] == (
        "track_two: predictor formation, surface bowl, seed 0, alignment paper, camera on_demand, drive pid"
    )
