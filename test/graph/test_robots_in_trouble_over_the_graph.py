"""One robot of several is lost, or one of its nodes is killed: how the run ends over the graph, and where all stand."""

import signal
from pathlib import Path

import pytest

from graph_tools import Killer, displacements, launch, short_scenario
from robot_formation import exit_codes
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.bag.reader import read_bag
from robot_formation.experiment.in_process import run_in_process

pytestmark = [pytest.mark.graph, pytest.mark.long, pytest.mark.xdist_group("trouble_over_the_graph")]

GROUND = (
    "world.surface_parameters=[size_m=2.6, curvature_per_m=0.06]",
    "start_x_m=0.82",
    "start_y_m=0.9",
    "world.overhead.enabled=false",
)


def test_when_a_followers_fine_tuner_is_killed_the_others_stand_in_good_order(tmp_path: Path) -> None:
    """In turns: those before it have finished its timestep, those behind it the one before, and no move is cut off."""
    node = "/follower_2/fine_tuner"
    killer = Killer(node, signal.SIGKILL, after_timesteps=2, robot="follower_1")
    scenario = short_scenario(*GROUND, "followers=3", "leader.timesteps=12", track="one", seed=5)
    result = launch(scenario, tmp_path / "bag", say=killer.say, on_start=killer.started)
    assert result.exit_code == exit_codes.NODE_DIED
    assert f"node {node} was killed by SIGKILL" in result.reason
    with read_bag(tmp_path / "bag") as bag:
        assert not bag.recovered
    found = load_run(tmp_path / "bag")
    driven = [len(found.leader_moved), *(len(follower.displacements) for follower in found.followers)]
    assert driven == sorted(driven, reverse=True)
    assert driven[0] - driven[-1] <= 1
    assert 2 <= driven[1] < 12
    for follower in (found.followers[0], found.followers[2]):
        assert len(follower.moved) == len(follower.commands)
        assert not follower.lost
    analysis = analyse(found)
    assert analysis.outcome == "incomplete"
    for told in (analysis.followers[0], analysis.followers[2]):
        assert all(t.formation_error_m is not None and t.formation_error_m < 0.03 for t in told.timesteps)


@pytest.mark.parametrize(
    "settings",
    [
        ("schedule=wave", "world.camera.pan_deg=-90"),
        # Two robots are pushed, one of them while all move, and one follower is blind.
        ("schedule=together", "leader.timesteps=3", "blackouts=[[follower_2, 3, 1]]",
         "pushes=[[follower_1, 2, 0.03, 0.0], [follower_2, 3, 0.0, -0.03]]"),
        # The leader's moves have two legs, and in turns the next robot's command may come before the leader's `moved`.
        ("schedule=turns", "leader.timesteps=2", "pushes=[[follower_1, 2, 0.03, 0.0]]",
         "leader.path=slalom", "leader.path_parameters=[step_m=0.03, period=8]"),
    ],
)  # fmt: skip
def test_trouble_is_the_same_over_the_graph_and_in_one_process(tmp_path: Path, settings: tuple[str, ...]) -> None:
    scenario = short_scenario(*GROUND, "followers=2", *settings, track="one")
    result = launch(scenario, tmp_path / "graph")
    again = run_in_process(scenario, tmp_path / "process", {})
    assert (result.exit_code, result.reason) == (again.exit_code, again.reason)
    if result.exit_code == exit_codes.LOST:
        assert result.reason.startswith("follower_1 lost its beacon neighbour in timestep 0: not found again in ")
        return
    for follower in (0, 1):
        assert displacements(tmp_path / "graph", follower) == displacements(tmp_path / "process", follower)
