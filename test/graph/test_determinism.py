"""The same scenario and seed give the same run to the last bit, whatever the machine does meanwhile."""

import os
from pathlib import Path

import pytest

from graph_tools import BusyCores, displacements, launch, short_scenario
from repository import HELPERS
from robot_formation.experiment.in_process import run_in_process

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("determinism")]

Displacements = list[tuple[int, float, float, float]]  # stamp, x, y and yaw of each


@pytest.fixture(scope="module")
def in_process(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Displacements]:
    """Displacements of the in-process run by camera mode."""
    found = {}
    for mode in ("on_demand", "stream"):
        bag = tmp_path_factory.mktemp("in_process") / "bag"
        result = run_in_process(short_scenario(f"world.camera.mode={mode}"), bag, {})
        assert result.exit_code == 0
        found[mode] = displacements(bag)
        assert len(found[mode]) == 4
    return found


@pytest.mark.parametrize("mode", ["on_demand", "stream"])
def test_the_node_graph_gives_the_in_process_run(
    tmp_path: Path, in_process: dict[str, Displacements], mode: str
) -> None:
    result = launch(short_scenario(f"world.camera.mode={mode}"), tmp_path / "bag")
    assert (result.exit_code, result.reason) == (0, "")
    assert displacements(tmp_path / "bag") == in_process[mode]


@pytest.mark.long
def test_loaded_cores_change_nothing(tmp_path: Path, in_process: dict[str, Displacements]) -> None:
    with BusyCores():
        result = launch(short_scenario(), tmp_path / "bag")
    assert result.exit_code == 0
    assert displacements(tmp_path / "bag") == in_process["on_demand"]


@pytest.mark.long
@pytest.mark.parametrize(("mode", "timesteps"), [("on_demand", 4), ("stream", 2)])
def test_random_delays_in_every_callback_change_nothing(
    tmp_path: Path,
    in_process: dict[str, Displacements],
    monkeypatch: pytest.MonkeyPatch,
    mode: str,
    timesteps: int,
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(HELPERS / "slow_callbacks"), prepend=os.pathsep)
    monkeypatch.setenv("SLOW_CALLBACKS", str(tmp_path))
    pids: dict[str, int] = {}
    scenario = short_scenario(f"world.camera.mode={mode}", f"leader.timesteps={timesteps}")
    result = launch(scenario, tmp_path / "bag", on_start=lambda domain, started: pids.update(started))
    assert result.exit_code == 0
    assert displacements(tmp_path / "bag") == in_process[mode][:timesteps]
    slowed = {name for name, pid in pids.items() if (tmp_path / str(pid)).exists()}
    assert slowed == set(pids) - {"/recorder"}


def test_another_seed_gives_another_run(tmp_path: Path, in_process: dict[str, Displacements]) -> None:
    run_in_process(short_scenario(seed=4), tmp_path / "bag", {})
    assert displacements(tmp_path / "bag") != in_process["on_demand"]
