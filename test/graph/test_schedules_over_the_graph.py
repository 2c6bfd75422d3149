"""Every schedule over the node graph: the run of one process, to the last bit, and nothing heard but neighbours."""

from pathlib import Path

import pytest

from graph_tools import BusyCores, displacements, launch, short_scenario
from graph_witness import FOLLOWER_NODES, witnessed_run
from robot_formation import names
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import Scenario

pytestmark = [pytest.mark.graph, pytest.mark.long, pytest.mark.xdist_group("schedules_over_the_graph")]

GROUND = (
    "world.surface_parameters=[size_m=2.6, curvature_per_m=0.06]",
    "start_x_m=0.82",
    "start_y_m=0.9",
    "followers=2",
    "leader.timesteps=4",
)
SLALOM = ("leader.path=slalom", "leader.path_parameters=[step_m=0.03, period=8]")
CASES = [
    ("schedule=wave", "formation=echelon"),
    ("schedule=together", *SLALOM),  # its moves have two legs
    ("schedule=timer", "spacing=delayed", *SLALOM),
]


def scenario(*settings: str) -> Scenario:
    return short_scenario(*GROUND, *settings, track="one")


@pytest.mark.parametrize("settings", CASES)
def test_the_graph_gives_the_in_process_run(tmp_path: Path, settings: tuple[str, ...]) -> None:
    with BusyCores():
        result = launch(scenario(*settings), tmp_path / "graph")
    assert (result.exit_code, result.reason) == (0, "")
    assert run_in_process(scenario(*settings), tmp_path / "process", {}).exit_code == 0
    for follower in (0, 1):
        found = displacements(tmp_path / "graph", follower)
        assert len(found) == 4
        assert found == displacements(tmp_path / "process", follower)


@pytest.mark.parametrize(
    ("schedule", "ticks"),
    [
        ("wave", {"/formation/leader/done", "/formation/follower_2/done"}),
        ("together", {"/formation/leader/begun", "/formation/follower_2/done"}),
        ("timer", set()),
    ],
)
def test_a_follower_hears_ticks_of_its_neighbours_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, schedule: str, ticks: set[str]
) -> None:
    chosen = scenario(f"schedule={schedule}", "leader.timesteps=2")
    witness = witnessed_run(chosen, tmp_path, monkeypatch, ticks)
    robot = names.follower(1)
    heard = set().union(*(witness.subscriptions[(f"/{robot}", name)] for name in FOLLOWER_NODES))
    foreign = {topic for topic in heard if not topic.startswith(f"/{robot}/")}
    assert foreign - {"/clock", "/parameter_events"} == ticks
    if not ticks:
        leaders = witness.subscriptions[("/leader", "leader")]
        assert not {topic for topic in leaders if topic.startswith("/formation/") or "follower" in topic}
