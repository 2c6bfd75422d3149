"""Two formations in one ROS domain, each in a namespace of its own, started from the table of processes."""

import subprocess
from functools import partial
from pathlib import Path

import pytest
import yaml

from graph_lab import Lab
from graph_tools import displacements, launch, short_scenario
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.bag.reader import read_bag
from robot_formation.experiment.scenario import Scenario
from robot_formation.launching.processes import Process, processes, progress

pytestmark = [pytest.mark.graph, pytest.mark.long, pytest.mark.xdist_group("namespaces")]

SITES = {"/site_a": 3, "/deep/site_b": 4}  # namespace and seed


def scenario(seed: int) -> Scenario:
    return short_scenario("leader.timesteps=3", seed=seed)


def start(lab: Lab, folder: Path, process: Process) -> subprocess.Popen[str]:
    file = folder / f"{process.name.strip('/').replace('/', '_')}.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": process.ros_parameters()}}))
    return lab.start(process.executable, "--params-file", str(file), namespace=process.namespace)


def has_ended(process: subprocess.Popen[str]) -> bool:
    return process.poll() is not None


def end(process: subprocess.Popen[str]) -> str:
    process.terminate()
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    return output


@pytest.fixture
def both(lab: Lab, tmp_path: Path) -> tuple[dict[str, Path], dict[str, str]]:
    """Run both formations at the same time; the bags by namespace, and what the followers of progress have printed."""
    running = {}
    for namespace, seed in SITES.items():
        bag = tmp_path / namespace.replace("/", "_")
        table = [*processes(scenario(seed), bag, namespace=namespace), progress(scenario(seed), namespace)]
        running[namespace] = (bag, {process.name: start(lab, tmp_path, process) for process in table})
    said, bags = {}, {}
    for namespace, (bag, nodes) in running.items():
        leader = nodes.pop(f"{namespace}/leader/leader")
        lab.until(partial(has_ended, leader))
        assert leader.returncode == 0, leader.communicate()
        recorder = nodes.pop(f"{namespace}/recorder")
        printed = {name: end(node) for name, node in nodes.items()}
        end(recorder)
        said[namespace], bags[namespace] = printed[f"{namespace}/progress"], bag
    return bags, said


def test_formations_in_namespaces_run_side_by_side_as_they_do_alone(
    both: tuple[dict[str, Path], dict[str, str]], tmp_path: Path
) -> None:
    bags, said = both
    for namespace, seed in SITES.items():
        alone = tmp_path / f"alone_{seed}"
        assert launch(scenario(seed), alone).exit_code == 0
        assert displacements(bags[namespace]) == displacements(alone)
        ours, theirs = (analyse(load_run(bag)).followers[0].timesteps for bag in (bags[namespace], alone))
        assert ours == theirs
        with read_bag(bags[namespace]) as bag:
            topics = set(bag.topics)
            reports = [status.name for m in bag.messages(["/diagnostics"]) for status in m.message.status]
        assert {topic for topic in topics if not topic.startswith(f"{namespace}/")} == {"/diagnostics"}
        assert all(name.startswith(f"{namespace}/") for name in reports)
        assert {f"{namespace}/clock", f"{namespace}/tf", f"{namespace}/formation/leader/done"} <= topics
        lines = said[namespace].splitlines()
        assert [line.split()[1] for line in lines] == ["1/3", "2/3", "3/3"], said
