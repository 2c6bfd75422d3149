"""A run that is watched in a browser: it moves there, it can be paused there, and it is the same run."""

from __future__ import annotations

import threading
import urllib.request
from pathlib import Path

import pytest

from chromium import Chromium
from graph_tools import displacements, launch, short_scenario
from robot_formation.experiment.in_process import run_in_process
from robot_formation.viewing.browser import address, check_viewer

pytest.importorskip("viser", reason="viser is not installed (extra 'view')")
pytestmark = [pytest.mark.graph, pytest.mark.slow, pytest.mark.xdist_group("viewer")]

TEXT = "document.body.innerText"
SIMULATED = rf"Number(({TEXT}.match(/([0-9.]+) s simulated/) || [0, 0])[1])"


def click(label: str) -> str:
    """Click a button, if there is one with this label; give whether there was."""
    return f"[...document.querySelectorAll('button')].some(each => each.innerText === '{label}' && !each.click())"


class Watcher(threading.Thread):
    """Looks at a run while it goes on, and leaves it running."""

    def __init__(self, port: int, folder: Path) -> None:
        super().__init__()
        self._port, self._folder = port, folder
        self.problem: BaseException | None = None
        self.seen: list[float] = []
        self.run_ended = threading.Event()

    def run(self) -> None:
        try:
            with Chromium(self._folder) as browser:
                browser.open(address(self._port))
                browser.until(f"{SIMULATED} > 0")
                self._watch(browser)
        except BaseException as problem:  # for the test's own thread
            self.problem = problem

    def _watch(self, browser: Chromium) -> None:
        browser.until(click("pause"))
        browser.until(f"{TEXT}.includes('the run is paused')")
        self.seen.append(browser.value(SIMULATED))
        browser.until(click("one step (50 ms)"))
        # A step was made, or none was due.
        browser.until(f"/paused: ([0-9.]+ s|.* have to order|nothing is owed)/.test({TEXT})")
        browser.until("[...document.querySelectorAll('canvas')].some(each => each.width > 200)")
        browser.until(click("go on"))
        # A browser that draws slowly may see the run's end before it has seen it go on; the run takes 100 s and more.
        moved = f"{SIMULATED} > {self.seen[-1] + 0.2}"
        browser.until(moved, unless=self.run_ended.is_set, deadline_s=300.0)
        if browser.value(moved):
            self.seen.append(browser.value(SIMULATED))
        assert browser.errors == []
        assert [url for url in browser.requests if not url.startswith(address(self._port))] == []


@pytest.mark.long
def test_a_run_moves_and_pauses_in_a_browser_and_stays_the_same(tmp_path: Path) -> None:
    # Slow, so that it goes on while a browser without a graphics card draws it.
    scenario = short_scenario("leader.timesteps=1", "world.real_time_factor=0.1")
    port = check_viewer(0)
    watcher = Watcher(port, tmp_path / "profile")
    said: list[str] = []

    def say(text: str) -> None:
        said.append(text)
        if text.startswith("view: "):
            watcher.start()

    result = launch(scenario, tmp_path / "bag", view_port=port, say=say)
    watcher.run_ended.set()
    assert f"view: {address(port)}" in " ".join(said)
    watcher.join()
    if isinstance(watcher.problem, pytest.skip.Exception):
        pytest.skip(str(watcher.problem))
    assert watcher.problem is None
    assert watcher.seen[0] > 0.0
    assert watcher.seen == sorted(watcher.seen)
    assert (result.exit_code, result.reason) == (0, "")
    alone = run_in_process(short_scenario("leader.timesteps=1"), tmp_path / "alone", {})
    assert alone.exit_code == 0
    assert displacements(tmp_path / "bag") == displacements(tmp_path / "alone")


def test_the_viewer_ends_with_its_run(tmp_path: Path) -> None:
    port = check_viewer(0)
    result = launch(short_scenario("leader.timesteps=1"), None, view_port=port)
    assert (result.exit_code, result.reason) == (0, "")
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(address(port), timeout=5.0)
    assert check_viewer(port) == port
