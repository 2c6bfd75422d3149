"""The live graph: who listens to what, and who calls whom."""

from pathlib import Path

import pytest

from graph_tools import short_scenario
from graph_witness import FOLLOWER_NODES, witnessed_run
from robot_formation import names

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("barrier")]


@pytest.mark.parametrize("followers", [pytest.param(1, marks=pytest.mark.long), 2])
def test_a_follower_hears_nothing_but_itself_and_its_neighbours_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, followers: int
) -> None:
    scenario = short_scenario(f"followers={followers}", "leader.timesteps=3", track="one")
    ticks = {robot: names.formation_done(names.beacon_neighbour(robot)).name for robot in scenario.robots[1:]}
    assert len(ticks) == followers
    witness = witnessed_run(scenario, tmp_path, monkeypatch, ticks.values())
    for robot, tick in ticks.items():
        heard_neighbour = False
        for name in FOLLOWER_NODES:
            heard = witness.subscriptions[(f"/{robot}", name)]
            allowed = {"/clock", "/parameter_events", tick}
            foreign = {topic for topic in heard if topic not in allowed and not topic.startswith(f"/{robot}/")}
            assert foreign == set(), f"{robot}/{name}"
            assert all(service.startswith(f"/{robot}/") for service in witness.clients[(f"/{robot}", name)])
            heard_neighbour = heard_neighbour or tick in heard
        assert heard_neighbour, "the whitelist would hold for a deaf follower too"


@pytest.mark.long
def test_the_witness_would_see_a_breach(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The world listens outside any robot's namespace: what the barrier's test looks for can be seen."""
    scenario = short_scenario("leader.timesteps=8")
    places = {
        "/leader/joint_commands": ("/", "world"),
        "/ground_truth/leader/odom": ("/", "recorder"),
        "/formation/follower_1/done": ("/leader", "leader"),
    }
    witness = witnessed_run(scenario, tmp_path, monkeypatch, places)
    assert [topic for topic, place in places.items() if topic not in witness.subscriptions[place]] == []
