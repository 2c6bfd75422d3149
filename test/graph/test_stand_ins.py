"""Runs whose nodes are partly started by somebody else: `--without`, and what comes of stand-ins that are missing."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from rclpy.node import Node

from examples import install_example
from graph_lab import DEADLINE_S, Lab
from graph_tools import displacements, formation, launch, short_scenario
from repository import ROOT
from robot_formation import names
from robot_formation.analysis.from_bag import load_run
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.reader import read_bag
from stand_ins import starter

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("stand_ins")]

DETECTOR = "follower_1/block_detector"


@pytest.fixture(scope="module")
def with_example(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Variables with which the example package is installed."""
    folder = tmp_path_factory.mktemp("installed")
    install_example("own_detector", folder, tmp_path_factory.mktemp("source"))
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder), os.environ.get("PYTHONPATH", "")])}


@contextlib.contextmanager
def stranger(lab: Lab, namespace: str) -> Iterator[None]:
    """A node called block_detector, of the test's own process."""
    node = Node("block_detector", namespace=namespace, context=lab.context)
    try:
        yield
    finally:
        node.destroy_node()


def test_the_example_holds_the_formation_with_its_own_detector_and_predictor(
    with_example: dict[str, str], tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "robot_formation.cli", "run", "--without", "block_detector", "--json"]
    command += ["--predictor", "own_detector.predictor:Smoothed", "--camera", "on_demand", "--seed", "3"]
    command += ["--set", "leader.timesteps=5", "--bag", str(tmp_path / "bag")]
    own = [sys.executable, "-m", "own_detector.node"]
    with (
        starter(lambda node: own, with_example) as others,
        subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=with_example
        ) as process,
    ):
        assert process.stdout is not None
        assert process.stderr is not None
        for line in process.stderr:
            others.say(line.strip())
        found = json.loads(process.stdout.read())
        assert process.wait() == 0
        (detector,) = others.started.values()
        assert detector.poll() is None
        detector.send_signal(signal.SIGINT)
        assert detector.wait(DEADLINE_S) == 0
    assert {f"/{DETECTOR} is there", f"/{DETECTOR} was there"} & set(others.said)
    assert (found["outcome"], found["stand_ins"]) == ("done", [DETECTOR])
    assert found["predictor"] == "own_detector.predictor:Smoothed"
    assert len(found["timesteps"]) == 5
    assert found["totals"]["formation_error_rmse_m"] < 0.02
    assert found["totals"]["losses"] == []
    with read_bag(tmp_path / "bag") as bag:
        assert json.loads(bag.metadata(METADATA_NAME)["stand_ins"]) == [DETECTOR]
        assert len(list(bag.messages([f"/{names.under('follower_1', names.BLOCKS.name)}"]))) > 20


def test_the_examples_own_tests_pass(with_example: dict[str, str]) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_own_detector.py"]
    folder = ROOT / "examples" / "own_detector"
    done = subprocess.run(command, cwd=folder, env=with_example, stdout=subprocess.PIPE, text=True, timeout=300)
    assert done.returncode == 0, done.stdout


@pytest.mark.long
def test_the_packages_own_nodes_started_by_hand_give_the_same_run(tmp_path: Path) -> None:
    scenario = short_scenario("followers=2", "leader.timesteps=2", track="one")
    left_out = ("world", "follower_2/block_detector", "leader/leader")
    said: list[str] = []
    with starter() as others:

        def say(text: str) -> None:
            said.append(text)
            others.say(text)

        result = launch(scenario, tmp_path / "by_hand", say=say, stand_ins=left_out)
    assert (result.exit_code, result.reason) == (0, "")
    assert set(others.started) == {f"/{node}" for node in left_out}
    for node in left_out:
        assert sum(text.startswith((f"/{node} is there", f"/{node} was there")) for text in said) == 1
    assert launch(scenario, tmp_path / "all").exit_code == 0
    for follower in range(2):
        one, other = (displacements(tmp_path / bag, follower) for bag in ("by_hand", "all"))
        assert one == other
        assert len(one) == 2


@pytest.mark.long
def test_a_killed_stand_in_ends_the_run_by_name_with_a_readable_bag(tmp_path: Path) -> None:
    with starter() as others:

        def say(text: str) -> None:
            others.say(text)
            # The launcher may see a stand-in later than the nodes do, up to 3 s.
            seen = f"/{DETECTOR} is there" in others.said
            if seen and text.startswith("timestep ") and not text.startswith("timestep  1/"):
                others.started[f"/{DETECTOR}"].kill()

        scenario = short_scenario("leader.timesteps=50")
        result = launch(scenario, tmp_path / "bag", say=say, stand_ins=(DETECTOR,))
    assert (result.exit_code, result.reason) == (4, f"node /{DETECTOR}, started elsewhere, is gone")
    assert len(load_run(tmp_path / "bag").followers[0].displacements) >= 2


def test_a_stand_in_that_never_comes_is_one_line_and_exit_code_4(tmp_path: Path) -> None:
    options = ("--without", "block_detector", "--stand-in-timeout", "0.5", "--bag", tmp_path / "bag", "--json")
    done = formation("run", "--camera", "on_demand", *options)
    reason = f"no node /{DETECTOR} appeared within 0.5 s"
    assert done.returncode == 4
    assert f"formation run: {reason}\n" in done.stderr
    assert "Traceback" not in done.stderr
    found = json.loads(done.stdout)
    assert (found["outcome"], found["reason"], found["stand_ins"]) == ("incomplete", reason, [DETECTOR])


def test_a_node_begins_once_those_that_it_waits_for_are_there(lab: Lab) -> None:
    options = ("-p", f"wait_for_nodes:=[{DETECTOR}]", "-p", "wait_for_listeners_s:=0.0")
    leader = lab.start("leader", *options, namespace="/site/leader")
    ticks = lab.collect(names.formation_done("leader", "/site/formation"))
    assert leader.stderr is not None
    assert f"waiting for /site/{DETECTOR}" in leader.stderr.readline()
    assert ticks == []
    with stranger(lab, "/site/follower_1"):
        lab.until(lambda: ticks)


def test_progress_of_a_launched_run_ends_with_4_when_a_stand_in_goes(lab: Lab) -> None:
    progress = lab.start("progress", "-p", f"stand_ins:=[{DETECTOR}]", namespace="/site")
    assert progress.stdout is not None
    assert "waiting for nodes that you start" in progress.stdout.readline()
    assert "-r __ns:=/site/follower_1 -r __node:=block_detector" in progress.stdout.readline()
    with stranger(lab, "/site/follower_1"):
        assert progress.stdout.readline() == f"/site/{DETECTOR} is there\n"
    _, errors = progress.communicate(timeout=DEADLINE_S)
    assert (progress.returncode, errors) == (4, f"node /site/{DETECTOR}, started elsewhere, is gone\n")


def test_progress_of_a_launched_run_ends_with_4_without_its_stand_in(lab: Lab) -> None:
    options = ("-p", f"stand_ins:=[{DETECTOR}]", "-p", "stand_in_timeout_s:=0.1")
    progress = lab.start("progress", *options)
    _, errors = progress.communicate(timeout=DEADLINE_S)
    assert (progress.returncode, errors) == (4, f"no node /{DETECTOR} appeared within 0.1 s\n")
