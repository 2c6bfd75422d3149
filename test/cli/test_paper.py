"""`formation paper` as a person types it, shortened: figures, page, numbers, going on, and what is refused."""

import contextlib
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from _pytest.capture import CaptureResult

from robot_formation.cli.main import main
from robot_formation.experiment import sweep_runs
from robot_formation.paper import work as work_module
from robot_formation.paper.statements import FIGURES

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("paper")]

QUICK = ("--seeds", "1", "--repeats", "1", "--step", "0.45", "--jobs", "1", "--set", "leader.timesteps=1")


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, CaptureResult[str]]:
    code = main(["paper", *map(str, arguments)])
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return code, captured


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that a call made, which was stopped by Ctrl-C before and went on."""
    folder = tmp_path_factory.mktemp("paper") / "out"
    command = [sys.executable, "-m", "robot_formation.cli", "paper", "--out", str(folder), *QUICK]
    stopped = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    motors = folder / "calibrations" / "motors.json"
    while not motors.exists() and stopped.poll() is None:
        with_timeout(stopped)
    stopped.send_signal(signal.SIGINT)
    _, errors = stopped.communicate(timeout=60)
    assert stopped.returncode == 130, errors
    assert "Traceback" not in errors
    assert f"goes on in {folder}" in errors
    before = motors.stat().st_mtime_ns
    assert main(["paper", "--out", str(folder), *QUICK]) == 0
    assert motors.stat().st_mtime_ns == before
    return folder


def with_timeout(process: subprocess.Popen[str]) -> None:
    """Wait a moment for a process to end."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=0.1)


def test_every_figure_is_there_and_lies_in_the_page(made: Path) -> None:
    page = (made / "index.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == len(FIGURES)
    for figure in FIGURES:
        assert (made / f"{figure.name}.png").stat().st_size > 8_000
        assert f'id="{figure.name}"' in page
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert [link for link in links if not link.startswith(("data:", "https://arxiv.org/"))] == []
    assert 'name="viewport"' in page


def test_the_page_tells_every_number_of_the_paper_with_ours(made: Path) -> None:
    page = (made / "index.html").read_text(encoding="utf-8")
    numbers = json.loads((made / "numbers.json").read_text())["figures"]
    for figure in FIGURES:
        entries = {entry["key"]: entry for entry in numbers[figure.name]}
        assert list(entries) == [stated.key for stated in figure.statements]
        for stated in figure.statements:
            assert entries[stated.key]["paper"] == stated.value
            assert stated.says in page.replace("&#x27;", "'")
    everything = [entry for entries in numbers.values() for entry in entries]
    assert page.count('<td class="agrees">') == sum(entry["agrees"] is True for entry in everything)
    assert page.count('<td class="differs">') == sum(entry["agrees"] is False for entry in everything)
    known: dict[str, Any] = {entry["key"]: entry for entry in everything}
    assert known["timesteps_two"]["difference"] == 1 - 20
    assert known["timesteps_two"]["agrees"] is False
    assert known["highest"]["ours"] == pytest.approx(208.42)
    assert known["window_px"]["agrees"] is True
    assert known["start_x_two_baseline"]["ours"] == pytest.approx(139.7, abs=0.01)
    for entry in everything:
        assert entry["agrees"] is True or entry["reason"] or entry["ours"] is None, entry["key"]


def test_another_call_measures_nothing_and_draws_in_another_format(
    made: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("this was measured before")

    for name in ("calibrate_motors", "measure_encoders", "carry_out", "record_run"):
        monkeypatch.setattr(work_module, name, never)
    monkeypatch.setattr(sweep_runs, "carry_out", never)
    code, said = call(capsys, "--out", made, "--format", "svg", "--json", *QUICK)
    assert code == 0
    found = json.loads(said.out)
    assert {Path(picture).suffix for picture in found["pictures"].values()} == {".svg"}
    assert "data:image/svg+xml;base64," in (made / "index.html").read_text(encoding="utf-8")


def test_a_folder_of_something_else_or_of_other_settings_is_refused(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    for arguments, wanted in (
        (["--out", tmp_path, *QUICK], "is not empty and holds no figures of the paper"),
        (["--out", tmp_path / "file", *QUICK], "choose another --out"),
        (["--out", made, *QUICK, "--set", "predictor.forgetting=0.9"], "start anew with --force"),
        (["--out", tmp_path / "new", *QUICK, "--set", "predictor.forgeting=0.9"], "did you mean"),
    ):
        code, said = call(capsys, *arguments)
        assert code == 2
        assert wanted in said.err
        assert said.err.count("\n") == 1
    assert not (tmp_path / "new").exists()
