"""The exported page: what is in its file, and that it works in a browser without a network."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from chromium import Chromium
from repository import ROOT
from robot_formation import names
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.reader import read_bag
from robot_formation.viewing import view_page
from robot_formation.viewing.browser import ViewError
from robot_formation.viewing.run_moments import RunMoments

pytest.importorskip("viser", reason="viser is not installed (extra 'view')")
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("view_page")]

FOLLOWER = names.follower(1)
SAMPLES = ROOT / "bags" / "samples"
OURS = re.compile(r"https?://(?:arxiv\.org|doi\.org|github\.com)/")
NAMESPACES = "http://www.w3.org/"  # names of SVG and the like, which nothing loads


def written(sample: str, path: Path) -> Path:
    with read_bag(SAMPLES / sample) as opened:
        bag = FormationBag(opened)
        warnings: list[str] = []
        size = view_page.write_page(path, bag, RunMoments(bag), warnings.append)
    assert warnings == []
    assert size == path.stat().st_size
    return path


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written("track_two_measured", tmp_path_factory.mktemp("view") / "run.html")


def data_of(page: Path) -> Any:
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.DOTALL)
    return json.loads(text)


def test_the_file_is_small_and_names_no_other_place(page: Path) -> None:
    assert page.stat().st_size < 8_000_000
    addresses = re.findall(r"https?://[^\s\"'<>&]*", page.read_text())
    assert [a for a in addresses if not OURS.match(a) and not a.startswith(NAMESPACES)] == []


def test_the_page_tells_what_the_analysis_does(page: Path) -> None:
    told = data_of(page)["followers"][FOLLOWER]
    with read_bag(SAMPLES / "track_two_measured") as opened:
        (follower,) = RunMoments(FormationBag(opened)).analysis.followers
    assert [t for t, _, _ in told["figures"]] == [timestep.t for timestep in follower.timesteps]
    for (_, correction_cm, error_cm), timestep in zip(told["figures"], follower.timesteps, strict=True):
        assert timestep.formation_error_m is not None
        assert error_cm == pytest.approx(100 * timestep.formation_error_m, abs=1e-3)
        assert correction_cm == pytest.approx(100 * (timestep.corrections.u_m + timestep.corrections.v_m), abs=1e-3)
    assert len(told["ends"]) == len(told["figures"])
    assert len(told["pictures"]) > 20
    assert data_of(page)["rendered"] is True


def test_pictures_of_the_bag_are_used_where_it_has_them(tmp_path: Path) -> None:
    data = data_of(written("pictures", tmp_path / "pictures.html"))
    assert data["rendered"] is False
    assert data["followers"][FOLLOWER]["pictures"]


def test_a_text_of_the_bag_can_not_end_the_pages_script(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state = "my state </script><script>alert(1)</script> @DATA@"
    with read_bag(SAMPLES / "track_two_measured") as opened:
        bag = FormationBag(opened)
        run = RunMoments(bag)
        object.__setattr__(run.record.followers[0], "states", (state,) * len(run.record.followers[0].states))
        monkeypatch.setattr(view_page, "_scene", lambda *arguments: "")
        monkeypatch.setattr(view_page, "_pictures", lambda *arguments: [])
        text = view_page.make_page(bag, run, print)
    assert "alert(1)</script>" not in text
    assert text.count("@DATA@") == len(run.record.followers[0].states)  # a text of the bag is no place to fill in


def test_too_large_a_page_and_a_place_that_can_not_be_written_are_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view_page, "make_page", lambda *arguments: "x" * 2000)
    with read_bag(SAMPLES / "track_two_measured") as opened:
        bag = FormationBag(opened)
        run = RunMoments(bag)
        with pytest.raises(ViewError, match="can't be written"):
            view_page.write_page(tmp_path / "missing" / "run.html", bag, run, print)
        monkeypatch.setattr(view_page, "MOST_BYTES", 1000)
        with pytest.raises(ViewError, match="nothing was written"):
            view_page.write_page(tmp_path / "run.html", bag, run, print)
    assert list(tmp_path.iterdir()) == []


def test_the_page_plays_and_steps_in_a_browser_without_network_and_errors(page: Path, tmp_path: Path) -> None:
    ends = data_of(page)["followers"][FOLLOWER]["ends"]
    with Chromium(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.until("typeof seconds === 'function' && seconds() > 0")  # it plays
        for number in (1, 2):  # a step pauses at the end of the next timestep
            wanted = next(end for end in ends if end > browser.value("seconds()") + 0.05)
            browser.value("document.getElementById('step').click()")
            second = browser.until(f"Math.abs(seconds() - {wanted}) < 0.15 && seconds()")
            assert second >= wanted - 0.05, number
        finished = sum(end <= wanted for end in ends)
        browser.until(f"element('time').textContent.includes(', {finished} of 20 timesteps finished')")
        assert browser.until("element('picture').naturalWidth") == 474
        assert browser.value("document.querySelectorAll('#plot circle').length") == 2 * finished
        browser.until("[...scene.contentDocument.querySelectorAll('canvas')].some(each => each.width > 200)")
        assert browser.value("document.documentElement.scrollWidth <= window.innerWidth")  # 400 px wide
        assert browser.errors == []
        assert browser.requests == [page.as_uri()]
