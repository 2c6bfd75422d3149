"""`formation view` and `formation run --view` as a person gets them wrong, and what they serve."""

import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from cli_tools import complaint
from repository import ROOT
from robot_formation.viewing.browser import check_viewer, open_browser

SAMPLE = ROOT / "bags" / "samples" / "track_two_measured"


@pytest.fixture
def taken() -> Iterator[int]:
    """A port of this machine that somebody else serves on."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@pytest.mark.parametrize("words", [["view", str(SAMPLE)], ["view", str(SAMPLE), "--html", "x.html"], ["run", "--view"]])
def test_a_missing_viser_is_said_with_what_installs_it(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    assert complaint(capsys, *words).endswith("this needs viser: pip install 'robot_formation[view]'")


@pytest.mark.parametrize("words", [["view", str(SAMPLE), "--port"], ["run", "--view", "--view-port"]])
def test_a_port_that_is_taken_or_none_is_said(words: list[str], taken: int, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser", reason="viser is not installed (extra 'view')")
    assert f"port {taken} of 127.0.0.1 can't be used (Address already in use)" in complaint(capsys, *words, str(taken))
    assert "'70000' is not a port" in complaint(capsys, *words, "70000")


def test_bags_that_are_missing_damaged_or_none_of_a_run_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("viser", reason="viser is not installed (extra 'view')")
    page = tmp_path / "page.html"
    damaged = tmp_path / "damaged"
    shutil.copytree(SAMPLE, damaged)
    (file,) = damaged.glob("*.mcap")
    content = bytearray(file.read_bytes())
    content[20_000:40_000] = bytes(20_000)
    file.write_bytes(bytes(content))
    for bag, said in ((tmp_path / "none", "none"), (damaged, "damaged"), (ROOT / "setup.py", "is not a bag")):
        assert said in complaint(capsys, "view", str(bag), "--html", page)
    assert not page.exists()


def test_a_view_in_one_process_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--in-process" in complaint(capsys, "run", "--in-process", "--view")


def test_without_a_display_it_is_said_how_to_open_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    line = open_browser("http://127.0.0.1:8080")
    assert line.startswith("view: http://127.0.0.1:8080 (no display here")
    assert "ssh -L 8080:127.0.0.1:8080" in line


def test_a_free_port_is_chosen_where_any_will_do() -> None:
    pytest.importorskip("viser", reason="viser is not installed (extra 'view')")
    assert check_viewer(0) > 1023


@pytest.mark.slow
def test_a_bag_is_served_until_an_interrupt() -> None:
    pytest.importorskip("viser", reason="viser is not installed (extra 'view')")
    command = [sys.executable, "-m", "robot_formation.cli", "view", str(SAMPLE), "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        assert process.stderr is not None
        lines = iter(process.stderr.readline, "")
        address = next(line for line in lines if line.startswith("view: ")).split()[1]
        with urllib.request.urlopen(address) as answer:
            assert b"<html" in answer.read()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert (process.returncode, out) == (0, "")
    assert "Traceback" not in err
