"""The live graph: who listens to what, and who calls whom."""

from pathlib import Path

import pytest

from graph_tools import launch, short_scenario
from graph_witness import FOLLOWER_NODES, Witness
from robot_formation import names

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("barrier")]


@pytest.mark.parametrize("followers", [1, 2])
def test_a_follower_hears_nothing_but_itself_and_its_neighbours_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, followers: int
) -> None:
    scenario = short_scenario(f"followers={followers}", "leader.timesteps=3", track="one")
    witness = Witness(scenario.robots, monkeypatch)
    result = launch(scenario, tmp_path / "bag", on_start=witness.started)
    witness.finish()
    assert result.exit_code == 0
    for number in range(1, followers + 1):
        robot = names.follower(number)
        tick = names.formation_done(names.beacon_neighbour(robot)).name
        heard_neighbour = False
        for name in FOLLOWER_NODES:
            heard = witness.subscriptions[(f"/{robot}", name)]
            allowed = {"/clock", "/parameter_events", tick}
            foreign = {topic for topic in heard if topic not in allowed and not topic.startswith(f"/{robot}/")}
            assert foreign == set(), f"{robot}/{name}"
            assert all(service.startswith(f"/{robot}/") for service in witness.clients[(f"/{robot}", name)])
            heard_neighbour = heard_neighbour or tick in heard
        assert heard_neighbour, "the whitelist would hold for a deaf follower too"


def test_the_witness_would_see_a_breach(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The world listens outside any robot's namespace: what the barrier's test looks for can be seen."""
    scenario = short_scenario("leader.timesteps=8")
    witness = Witness(scenario.robots, monkeypatch)
    launch(scenario, tmp_path / "bag", on_start=witness.started)
    witness.finish()
    assert "/leader/joint_commands" in witness.subscriptions[("/", "world")]
    assert "/ground_truth/leader/odom" in witness.subscriptions[("/", "recorder")]
    assert "/formation/follower_1/done" in witness.subscriptions[("/leader", "leader")]
