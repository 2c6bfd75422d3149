"""Where a bag is written: taken paths are refused before anything starts, and default names are never shared."""

import errno
import os
import socket
from argparse import Namespace
from pathlib import Path

import pytest

from cli_tools import complaint
from graph_tools import launch, short_scenario
from robot_formation import paths
from robot_formation.bag.bag_path import PathReservation, check_free, reserve_new
from robot_formation.bag.errors import BagError
from robot_formation.cli import record, run
from robot_formation.experiment.in_process import run_in_process


@pytest.mark.parametrize("suffix", ["", ".partial", ".cut_off"])
def test_a_link_that_leads_nowhere_is_taken_too(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"bag{suffix}").symlink_to(tmp_path / "nowhere")
    with pytest.raises(BagError, match="exists already"):
        check_free(tmp_path / "bag")


def test_a_dangling_link_as_bag_is_refused_before_anything_starts(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    bag.symlink_to(tmp_path / "nowhere")
    for how in ((), ("--in-process",)):
        assert "exists already" in complaint(capsys, "run", "--bag", bag, *how)
    with pytest.raises(BagError, match="exists already"):
        launch(short_scenario(), bag)
    assert os.listdir(tmp_path) == ["bag"]


def test_a_reserved_path_is_nobody_elses(tmp_path: Path) -> None:
    with (
        PathReservation(tmp_path / "bag"),
        pytest.raises(BagError, match="another run"),
        PathReservation(tmp_path / "bag"),
    ):
        pass
    with PathReservation(tmp_path / "bag"):
        pass


def test_a_reservation_can_be_taken_before_it_is_entered(tmp_path: Path) -> None:
    reservation = PathReservation(tmp_path / "bag")
    assert reservation.take()
    with reservation:
        assert not PathReservation(tmp_path / "bag").take()
    again = PathReservation(tmp_path / "bag")
    assert again.take()
    again.release()


def test_a_path_that_cannot_be_reserved_is_said_and_no_name_is_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed, tries = [], []

    class Refused:
        def __init__(self, *kind: object) -> None:
            pass

        def bind(self, address: str) -> None:
            tries.append(address)
            assert len(tries) < 10, "it goes on for ever"
            raise PermissionError(errno.EACCES, "Permission denied")

        def close(self) -> None:
            closed.append(True)

    monkeypatch.setattr(socket, "socket", Refused)
    with pytest.raises(BagError, match=r"run can't be reserved: Permission denied$"):
        reserve_new(tmp_path, "run")
    with pytest.raises(BagError, match="reserved: Permission denied"), PathReservation(tmp_path / "bag"):
        pass
    assert len(closed) == len(tries) == 2


def test_names_are_counted_on_while_the_others_are_reserved_or_there(tmp_path: Path) -> None:
    (tmp_path / "run_2").mkdir()
    (tmp_path / "run_4.partial").mkdir()
    (tmp_path / "run_5").symlink_to(tmp_path / "nowhere")
    held = [reserve_new(tmp_path, "run") for _ in range(3)]
    assert [reservation.path.name for reservation in held] == ["run", "run_3", "run_6"]
    for reservation in held:
        reservation.release()


def test_runs_and_recordings_begun_in_the_same_second_have_bags_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paths, "default_bags_dir", lambda: tmp_path)
    monkeypatch.setattr("time.strftime", lambda form: form.replace("%Y%m%d-%H%M%S", "20260101-120000"))
    options, scenario = Namespace(bag=None), short_scenario()
    with run.reserve(options, scenario) as first, run.reserve(options, scenario) as second:
        assert second.path.name == f"{first.path.name}_2"
        # Reserved from the choice on: the run itself takes the same reservation.
        result = run_in_process(short_scenario("leader.timesteps=1"), second.path, {}, reservation=second)
        assert result.bag is not None
        assert result.bag.is_dir()
    with record.default_bag() as first, record.default_bag() as second:
        assert second.path.name == f"{first.path.name}_2"
