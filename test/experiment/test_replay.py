"""A recorded run gives the same answers again, and other parameters show what would have changed."""

import json
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import pytest

from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.writer import BagWriter
from robot_formation.cli.main import main
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.recorded_run import Recording
from robot_formation.experiment.replay import replay_detector, replay_predictor
from robot_formation.experiment.replay_fine_tuner import replay_fine_tuner
from robot_formation.launching.processes import run_metadata
from robot_formation.parameters import ParameterError

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("replay")]

TIMESTEPS = 6


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bag of a short run with pictures."""
    bag = tmp_path_factory.mktemp("replay") / "run"
    settings = ["seed=3", f"leader.timesteps={TIMESTEPS}", "world.camera.mode=on_demand", "predictor.forgetting=0.9"]
    settings += ["predictor.name=measured", "fine_tuner.mode=paper"]
    scenario = scenarios.override(scenarios.load_track("two"), settings)
    run_in_process(scenario, bag, run_metadata(scenario), images=True)
    return bag


@pytest.fixture(scope="module")
def formation_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bag of a short run with a predictor that uses everything it can hear, and keeps its state."""
    folder = tmp_path_factory.mktemp("replay")
    settings = ["seed=3", f"leader.timesteps={TIMESTEPS}", "world.camera.mode=on_demand", "predictor.name=formation"]
    state = f"predictor.state_file={folder / '{robot}.json'}"
    scenario = scenarios.override(scenarios.load_track("one"), [*settings, state, "predictor.load_state=true"])
    run_in_process(scenario, folder / "run", run_metadata(scenario))
    return folder / "run"


@pytest.fixture
def recording(run: Path) -> Iterator[Recording]:
    with read_bag(run) as bag:
        yield Recording(bag)


def copied(run: Path, target: Path, *, without: Collection[str] = (), details: dict[str, str] | None = None) -> Path:
    """A copy of a bag that lacks some topics, or whose metadata say something else."""
    with read_bag(run) as bag, BagWriter(target) as writer:
        writer.write_metadata(METADATA_NAME, bag.metadata(METADATA_NAME) if details is None else details)
        types = {topic: kind for topic, kind in bag.topics.items() if topic not in without}
        for topic, kind in types.items():
            writer.add_topic(topic, kind, TopicQos())
        for message in bag.raw_messages(types):
            writer.write(message.topic, message.cdr, message.stamp_ns, log_time_ns=message.stamp_ns)
    return target


@pytest.mark.parametrize("replay", [replay_predictor, replay_fine_tuner, replay_detector])
def test_the_same_parameters_give_the_same_answers(
    recording: Recording, replay: Callable[[Recording, dict[str, Any]], list[Any]]
) -> None:
    (found,) = replay(recording, {})
    assert found.robot == "follower_1"
    assert found.identical
    assert found.changed == 0
    assert len(found.rows) >= TIMESTEPS


def test_a_precise_alignment_decides_as_it_did(formation_run: Path) -> None:
    with read_bag(formation_run) as bag:
        (found,) = replay_fine_tuner(Recording(bag), {})
    assert found.identical
    assert any(row.recorded.corrections for row in found.rows)


def test_a_predictor_gets_what_was_commanded_too_and_its_state_file_is_left_alone(
    formation_run: Path, tmp_path: Path
) -> None:
    state = formation_run.parent / "follower_1.json"
    before = state.read_bytes()
    with read_bag(formation_run) as bag:
        formation = Recording(bag)
        (found,) = replay_predictor(formation, {})
    assert found.identical
    assert len(found.rows) == TIMESTEPS
    assert state.read_bytes() == before
    assert [note for note in formation.notes if "state file" in note]
    with read_bag(copied(formation_run, tmp_path / "bag", without=("/follower_1/commanded",))) as bag:
        (deaf,) = replay_predictor(Recording(bag), {})
    assert deaf.changed > 0


def test_every_follower_is_shown_its_blocks_at_its_own_place(tmp_path: Path) -> None:
    settings = ["followers=2", "slots=[[0.32, -0.05], [0.34, 0.0]]", "start_y_m=0.3", "world.camera.mode=on_demand"]
    scenario = scenarios.override(scenarios.load_track("one"), [*settings, "leader.timesteps=2"])
    run_in_process(scenario, tmp_path / "run", run_metadata(scenario))
    with read_bag(tmp_path / "run") as bag:
        assert [found.identical for found in replay_fine_tuner(Recording(bag), {})] == [True, True]


def test_a_replay_goes_on_from_a_state_file_if_told(formation_run: Path) -> None:
    state = str(formation_run.parent / "{robot}.json")
    with read_bag(formation_run) as bag:
        (found,) = replay_predictor(Recording(bag), {"state_file": state, "load_state": True})
    assert found.changed > 0
    assert found.rows[1].today is not None


@pytest.mark.parametrize("replay", [replay_predictor, replay_fine_tuner])
def test_a_replay_gives_the_same_twice(
    recording: Recording, replay: Callable[[Recording, dict[str, Any]], list[Any]]
) -> None:
    changes = {"name": "previous"} if replay is replay_predictor else {"alignment.v_tolerance_px": 12.0}
    assert replay(recording, changes) == replay(recording, changes)


def test_the_previous_displacement_is_what_that_predictor_would_have_said(recording: Recording, run: Path) -> None:
    from robot_formation.analysis.from_bag import load_run

    (found,) = replay_predictor(recording, {"name": "previous"})
    moved = [entry.motion for entry in load_run(run).followers[0].displacements]
    assert len(found.rows) == TIMESTEPS
    assert found.rows[0].today is None
    for row, before in zip(found.rows[1:], moved, strict=False):
        assert row.today is not None
        assert (row.today.x_m, row.today.y_m) == pytest.approx((before.x_m, before.y_m))
    assert not found.identical
    # Until two pairs are known, 'measured' repeats the previous displacement too.
    assert [row.timestep for row in found.rows if row.recorded != row.today] == list(range(4, TIMESTEPS + 1))
    assert found.rmse_m("recorded") != found.rmse_m("today")


def test_the_ideal_move_is_displacement_and_residual_together(recording: Recording, run: Path) -> None:
    from robot_formation.analysis.from_bag import load_run

    follower = load_run(run).followers[0]
    (found,) = replay_predictor(recording, {})
    for row, moved, left in zip(found.rows, follower.displacements, follower.residuals, strict=True):
        assert row.ideal is not None
        ideal = moved.motion.then(left.motion)  # the residual is told in the frame in which the displacement ends
        assert (row.ideal.u_m, row.ideal.v_m) == pytest.approx((ideal.u_m, ideal.v_m))


def test_a_wider_tolerance_asks_for_fewer_corrections(recording: Recording) -> None:
    (found,) = replay_fine_tuner(recording, {"alignment.v_tolerance_px": 30.0, "alignment.u_tolerance_m": 0.1})
    assert found.changed > 0
    assert not any(row.beyond for row in found.rows)
    assert all(len(row.today.moves) <= len(row.recorded.moves) for row in found.rows)
    assert {row.today.outcome for row in found.rows} == {"aligned"}


def test_a_narrower_tolerance_asks_for_one_correction_that_nothing_recorded_answers(recording: Recording) -> None:
    (found,) = replay_fine_tuner(recording, {"alignment.v_tolerance_px": 0.0, "alignment.u_tolerance_m": 0.0})
    beyond = [row for row in found.rows if row.beyond]
    assert beyond
    for row in beyond:
        assert len(row.today.moves) == len(row.recorded.moves) + 1
        assert row.today.outcome.startswith("correct")
    assert not [note for note in recording.notes if "not aligned" in note]


def test_another_signature_filter_changes_blocks(recording: Recording) -> None:
    (found,) = replay_detector(recording, {"min_block_area": 2000})
    assert 0 < found.changed <= len(found.rows)


def test_unknown_changes_and_missing_topics_are_told(run: Path, recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no parameter 'forgeting'; did you mean 'forgetting'"):
        replay_predictor(recording, {"forgeting": 0.5})
    bag = copied(run, tmp_path / "bag", without=("/follower_1/camera/image_raw", "/follower_1/residual"))
    with read_bag(bag) as opened:
        poor = Recording(opened)
        with pytest.raises(BagError, match="no messages on '/follower_1/camera/image_raw'"):
            replay_detector(poor, {})
        with pytest.raises(BagError, match="no messages on '/follower_1/residual'"):
            replay_predictor(poor, {})


def test_other_versions_and_parameters_that_are_gone_are_noted(run: Path, tmp_path: Path) -> None:
    parameters = {"predictor": {"name": "previous", "magic": 3}}
    details = {"parameters": json.dumps(parameters), "versions": json.dumps({"numpy": "0.1"}), "git_commit": "abc"}
    with read_bag(copied(run, tmp_path / "bag", details=details)) as opened:
        old = Recording(opened)
        (found,) = replay_predictor(old, {})
    assert found.changed > 0
    text = "\n".join(old.notes)
    for words in ("numpy 0.1", "commit abc", "predictor.magic is no parameter any more"):
        assert words in text


def test_a_bag_without_parameters_is_replayed_with_the_defaults(formation_run: Path, tmp_path: Path) -> None:
    with read_bag(copied(formation_run, tmp_path / "bag", details={})) as opened:
        bare = Recording(opened)
        assert replay_fine_tuner(bare, {})[0].identical
    assert "the defaults are taken" in bare.notes[0]


def test_a_bag_of_something_else_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/words", "std_msgs/msg/String", TopicQos())
        writer.write("/words", bytes([0, 1, 0, 0, 1, 0, 0, 0, 0]), 0)
    with read_bag(tmp_path / "bag") as bag, pytest.raises(BagError, match="no topics of a follower"):
        Recording(bag)


@pytest.mark.parametrize(
    ("arguments", "identical"),
    [
        ([], True),
        (["--predictor", "measured"], True),
        (["--predictor", "literal"], False),
        (["--set", "predictor.forgetting=0.5"], False),
        (["--fine-tuner"], True),
        (["--detector"], True),
        (["--images", "--set", "block_detector.min_block_area=2000"], False),
    ],
)
def test_the_verb_prints_tables_and_json(
    run: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], identical: bool
) -> None:
    assert main(["replay", str(run), *arguments]) == 0
    said = capsys.readouterr().out
    assert said.strip().splitlines()[-1].startswith("identical to the recording" if identical else "changed in")
    assert main(["replay", str(run), *arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["followers"][0]["identical"] is identical
    assert (found["followers"][0]["changed"] == 0) is identical


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--predictor", "mesured"], "did you mean 'measured'?"),
        (["--set", "leader.timesteps=3"], "predictor.NAME=VALUE"),
        (["--set", "predictor.forgetting"], "predictor.NAME=VALUE"),
        (["--set", "predictor.forgetting=2"], "outside"),
    ],
)
def test_what_cannot_be_replayed_is_one_line(
    run: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert main(["replay", str(run), *arguments]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert words in line
