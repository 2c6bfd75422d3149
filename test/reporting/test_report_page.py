"""`formation report`: one page without anything from outside, of runs and of sweeps."""

import html.parser
import json
import re
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from chromium import Chromium
from cli_tools import complaint
from report_samples import MEASURED, PREVIOUS, made_up_sweep
from repository import ROOT
from robot_formation.analysis.sweep_summary import summarise
from robot_formation.cli.main import main
from robot_formation.cli.sweep import seeds
from robot_formation.experiment.sweep import read_sweep
from robot_formation.reporting.citation import bibtex
from robot_formation.reporting.inline_svg import inlined
from robot_formation.reporting.markup import element, fill, page_text, section
from robot_formation.reporting.page import PageError, PageSpace, write_page
from robot_formation.reporting.report import default_path, report_page
from robot_formation.reporting.runs import load_runs
from robot_formation.reporting.sweep_sections import repeating_command
from robot_formation.reporting.words import answer, how_it_was_held, what_was_run
from synthetic_bag import STEPS, write_run

pytestmark = pytest.mark.xdist_group("report_page")

VOID = {"meta", "link", "br", "img"}
HOSTS = r"(?:[\w.-]*\.)?(?:arxiv|doi|github)\.\w+"
EVIL = "<script>alert('&1')</script>"


class Reader(html.parser.HTMLParser):
    """Reads a page strictly: every element is closed where it has to be, and no id comes twice."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.headings: list[str] = []
        self.texts: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.feed(text)
        self.close()
        assert self.open == []
        assert len(set(self.ids)) == len(self.ids)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        self.ids += [value or "" for name, value in attrs if name == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)
        if self.open and re.fullmatch(r"h[1-6]", self.open[-1]):
            self.headings.append(data)

    @property
    def scripts(self) -> int:
        return self.tags.count("script")

    @property
    def levels(self) -> list[int]:
        return [int(tag[1]) for tag in self.tags if re.fullmatch(r"h[1-6]", tag)]


@pytest.fixture(scope="module")
def run_page() -> str:
    return report_page([MEASURED])


@pytest.fixture(scope="module")
def mixed_page(tmp_path_factory: pytest.TempPathFactory) -> str:
    return report_page([PREVIOUS, MEASURED, made_up_sweep(tmp_path_factory.mktemp("sweeps") / "sweep")])


def test_a_runs_page_has_every_section_and_figure(run_page: str) -> None:
    reader = Reader(run_page)
    assert reader.headings == [
        "track_two: track_two_measured",
        "What was run",
        "Did it hold the formation?",
        "Corrections and errors",
        "Replay",
        "Timesteps",
        "Totals",
        "Parameters that differ from the defaults",
        "Repeat this run",
        "Versions",
        "Cite",
    ]
    assert {"run-1-corrections", "run-1-errors", "run-1-trajectory"} <= set(reader.ids)
    assert reader.tags.count("figure") == reader.tags.count("svg") == 3
    assert "predictor.name" in reader.texts
    command = "formation run --track two --seed 3 --camera on_demand --predictor measured --set fine_tuner.mode=paper"
    assert command in reader.texts


def test_a_page_of_several_compares_and_has_each_ones_own_sections(mixed_page: str) -> None:
    reader = Reader(mixed_page)
    for heading in ("Side by side", "What differs", "Run 1: track_two_previous", "Run 2: track_two_measured"):
        assert reader.headings.count(heading) == 1
    assert reader.headings.count("Totals") == 2
    figures = {name for name in reader.ids if re.fullmatch(r"(all|run-\d|sweep-1)-\w+", name)}
    assert figures >= {
        *("all-corrections", "all-errors", "all-trajectories", "run-1-errors", "run-2-errors"),
        *("sweep-1-reductions", "sweep-1-1", "sweep-1-2"),
    }
    links = [value for name, value in reader.attributes if name == "href" and re.fullmatch(r"#run-\d", value)]
    assert links == ["#run-1", "#run-2"]
    assert set(links) <= {f"#{name}" for name in reader.ids}


@pytest.mark.parametrize("page", ["run_page", "mixed_page"])
def test_pages_are_whole_accessible_and_small(page: str, request: pytest.FixtureRequest) -> None:
    text = request.getfixturevalue(page)
    reader = Reader(text)
    assert len(text.encode()) < 5_000_000
    levels = reader.levels
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert ("lang", "en") in reader.attributes
    images = [value for name, value in reader.attributes if name == "aria-labelledby"]
    assert len(images) == reader.tags.count("svg") > 0
    assert set(images) <= set(reader.ids)
    assert reader.tags.count("th") > 0
    assert reader.tags.count("caption") == reader.tags.count("table")
    around = re.sub(r'<iframe srcdoc="[^"]*"', "<iframe", text)  # the viewer's own page is tested with the viewer
    assert set(re.findall(r"https?://([^/\s\"'<>]+)", around)) <= set(re.findall(HOSTS, around))
    references = {value[1:] for name, value in reader.attributes if name == "href" and value.startswith("#")}
    references |= set(re.findall(r"url\(#([^)]+)\)", text))
    assert references <= set(reader.ids)


@pytest.mark.slow
def test_pages_open_in_a_narrow_browser_without_network_and_errors(mixed_page: str, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(mixed_page, encoding="utf-8")
    with Chromium(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.until("document.readyState === 'complete' && document.querySelectorAll('h2').length > 5")
        assert browser.value("document.documentElement.scrollWidth <= window.innerWidth")  # 400 px wide
        small = "[...document.querySelectorAll('figure svg')].filter(each => each.getBoundingClientRect().height < 100)"
        assert browser.value(f"{small}.length") == 0
        assert browser.errors == []
        assert browser.requests == [page.as_uri()]


@pytest.mark.slow
def test_what_a_page_asks_for_or_complains_of_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("<!DOCTYPE html><link rel=icon href=data:,><img src=http://example.com/a.png><script>no()</script>")
    with Chromium(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.until("document.readyState === 'complete' && document.images[0].complete")
        assert len(browser.errors) == 2
        assert browser.requests == [page.as_uri(), "http://example.com/a.png"]


def test_texts_from_outside_stay_texts(tmp_path: Path) -> None:
    evil = tmp_path / "<img src=x onerror=alert(1)>"
    parameters = json.dumps({"predictor": {"name": EVIL}, EVIL: {EVIL: 1}})
    details = {"scenario": EVIL, "predictor": EVIL, "surface": EVIL, "git_commit": EVIL, "parameters": parameters}
    details["versions"] = json.dumps({EVIL: EVIL})
    odd = write_run(tmp_path / "a$b$c^{\x1b\x01", STEPS)
    two = write_run(tmp_path / "two", STEPS, followers=2, lost=["follower_2"])
    bags = [write_run(evil, STEPS, details=details), odd, two]
    reader = Reader(report_page(bags))
    assert reader.scripts == 0
    assert "img" not in reader.tags
    assert any(EVIL in text for text in reader.texts)
    assert "\N{REPLACEMENT CHARACTER}" in page_text(element("p", "\x1b[31m\ud800"))


def test_a_page_takes_what_fits() -> None:
    space = PageSpace(1000)
    small, large = section("Small", "x" * 400), section("Large", "x" * 700)
    assert space.take(small, "no room") is small
    assert space.take(large, "no room").text == "no room"
    assert space.take(small, "no room") is small


def test_a_damaged_sweep_or_a_wrong_source_is_told_in_a_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    sweep = made_up_sweep(tmp_path / "sweep")
    assert "given twice" in complaint(capsys, "report", MEASURED, MEASURED)
    assert "given twice" in complaint(capsys, "report", sweep, sweep / ".")
    assert "is not a bag" in complaint(capsys, "report", ROOT / "docs")
    (tmp_path / "file").touch()
    assert "can't be written" in complaint(capsys, "report", sweep, "--out", tmp_path / "file" / "page.html")
    runs = (sweep / "runs.csv").read_text()
    (sweep / "runs.csv").write_text(runs.splitlines()[0] + "\n")
    assert "no run of the sweep yet" in complaint(capsys, "report", sweep)
    (sweep / "runs.csv").write_text(runs.replace("done,15", "done,x"))
    assert "can't be read" in complaint(capsys, "report", sweep)
    (sweep / "sweep.json").write_text('{"tracks": 3}')
    assert "no record of a sweep" in complaint(capsys, "report", sweep)


def test_the_page_goes_where_told_or_to_its_source(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    sweep = made_up_sweep(tmp_path / "sweep", surfaces=("bowl",))
    assert main(["report", str(sweep)]) == 0
    assert capsys.readouterr().out.startswith(f"report: {sweep / 'report.html'} (")
    assert Reader((sweep / "report.html").read_text(encoding="utf-8")).headings[0] == "Sweep: sweep"
    assert default_path([tmp_path / "a"]) == tmp_path / "a_analysis" / "report.html"
    assert default_path([tmp_path / "a", sweep]) == tmp_path / "a_analysis" / "comparison.html"
    assert write_page(lambda: "page", tmp_path / "new" / "page.html").read_text() == "page"


def test_a_place_that_can_not_be_written_is_told_before_the_work_and_an_older_page_stays(tmp_path: Path) -> None:
    def work() -> str:
        raise KeyboardInterrupt

    (tmp_path / "page.html").write_text("older")
    for place in ("page.html/page.html", "page.html/new/page.html", "."):
        with pytest.raises(PageError, match="can't be written"):
            write_page(work, tmp_path / place)
    for place in ("page.html", "new/folder/page.html"):
        with pytest.raises(KeyboardInterrupt):
            write_page(work, tmp_path / place)
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert (tmp_path / "page.html").read_text() == "older"


def test_a_sweeps_page_tells_its_summary_by_track_path_and_surface(tmp_path: Path) -> None:
    sweep = made_up_sweep(tmp_path / "sweep")
    reader = Reader(report_page([sweep]))
    assert {"Track one, bowl", "Track one, ripple", "Reduction against previous"} <= set(reader.headings)
    entry = summarise(read_sweep(sweep)[1])[1]
    assert entry["predictor"] == "measured"
    correction = entry["correction_m"]
    assert f"{100.0 * correction['median']:.1f} ({100.0 * correction['low']:.1f} to lost)" in reader.texts
    assert "2 of 24 runs were lost: they did not come to their last timestep." in reader.texts
    command = "formation sweep --tracks one --surfaces bowl,ripple --predictors previous,measured --seeds 0:6 --set "
    assert f"{command}predictor.forgetting=0.9" in reader.texts


def test_the_command_of_a_sweep_gives_its_seeds_again(tmp_path: Path) -> None:
    plan, _ = read_sweep(made_up_sweep(tmp_path / "sweep"))
    for chosen in ((0, 1, 2), (7,), (0, 1, 5, 7, 8, 9), (3, 2, 1)):
        words = repeating_command(replace(plan, seeds=chosen)).split()
        assert seeds(words[words.index("--seeds") + 1]) == chosen


def test_many_seeds_stay_within_the_pages_size(tmp_path: Path) -> None:
    page = report_page([made_up_sweep(tmp_path / "sweep", surfaces=("bowl",), seeds=300)])
    assert len(page.encode()) < 500_000
    assert "200 of 300 seeds are drawn" in page


def test_the_citation_is_the_readmes() -> None:
    (text,) = re.findall(r"```bibtex\n(.*?)\n```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert bibtex() == text


def test_figures_keep_their_ids_apart_and_follow_the_scheme() -> None:
    svg = """<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" width="3pt">
      <metadata>https://example.com</metadata><defs><style>*{fill: red}</style><path id="m"/></defs>
      <g clip-path="url(#c)"><use xlink:href="#m" style="fill: #ebebeb; stroke: #0072b2"/></g></svg>"""
    one = page_text(fill(element("div"), inlined(svg, "one")))
    assert "example.com" not in one
    assert "red" not in one
    for said in ('id="one-m"', 'href="#one-m"', 'clip-path="url(#one-c)"', "fill: var(--grey-eb); stroke: #0072b2"):
        assert said in one
    assert "width" not in one


def test_a_bag_that_was_cut_off_is_told_in_words(tmp_path: Path) -> None:
    bag = tmp_path / "run.partial"
    shutil.copytree(MEASURED, bag)
    (bag / "metadata.yaml").unlink()
    (run,) = load_runs([bag])
    assert answer(run) == "Yes, to the end."
    (follower,) = run.analysis.followers
    assert "finished 20 of 20 timesteps" in how_it_was_held(run, follower)
    assert "The leader drives the path “straight” for 20 timesteps." in what_was_run(run)
