"""The pages' form, and what they state about behaviour: rooms, files, commands, keys, limits, figures."""

import inspect
import json
import math
import re
import shlex
from pathlib import Path

import pytest
from test_docs import NODE_PAGES, PAGES
from test_layers import LAYERS

from repository import PACKAGE, ROOT
from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.report import text_report
from robot_formation.cli.main import main as command_line
from robot_formation.cli.main import make_parser
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.scenario import load_track, override
from robot_formation.follower.fine_tuning import FineTunerParameters, LookParameters, Phase
from robot_formation.launching.watchdog import Watchdog

ARCHITECTURE = ROOT / "docs" / "explanation" / "architecture.md"
FILES = [
    *(file.name for file in ROOT.glob("*.py")),
    *(
        file.relative_to(ROOT).as_posix()
        for folder in ("robot_formation", "test", "bench", "docs", "launch")
        for file in (ROOT / folder).rglob("*.py")
    ),
]
LONGEST_ITEM = 85  # words
RE_BLOCK = re.DOTALL | re.MULTILINE


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def code_blocks(text: str) -> list[list[str]]:
    """The lines of each code block that names no language."""
    return [block.splitlines() for block in re.findall(r"^```\n(.*?)^```", text, re.DOTALL | re.MULTILINE)]


def rows_of(page: Path) -> list[tuple[str, str, str]]:
    """The rows of the first table below the heading Rooms: (room, holds, where to look for what)."""
    section = text_of(page).split("## Rooms\n")[1].split("\n## ")[0]
    return re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \|$", section, re.MULTILINE)


def test_the_architecture_lists_every_room_in_the_order_of_the_layers() -> None:
    rooms = [room for layer in reversed(LAYERS) for room in layer if (PACKAGE / room).is_dir() and room]
    assert [room for room, _, _ in rows_of(ARCHITECTURE)] == rooms


def test_what_the_architecture_places_in_a_room_is_there() -> None:
    for room, _, places in rows_of(ARCHITECTURE):
        for place in re.findall(r"`([\w*]+(?:\.py|/))`", places):
            assert list((PACKAGE / room).glob(place.rstrip("/"))), f"{room}: {place}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_that_a_page_names_exist(page: Path) -> None:
    """In backticks or in commands: Python files by the end of their path, folders of the package by theirs."""
    text = text_of(page)
    named = set(re.findall(r"`([\w/]+\.py)`", text)) | set(re.findall(r"python ([\w/]+\.py)", text))
    missing = {name for name in named if not any(f"/{file}".endswith(f"/{name}") for file in FILES)}
    missing |= {folder for folder in re.findall(r"`(robot_formation/[a-z_/]+)`", text) if not (ROOT / folder).exists()}
    assert missing == set()


def test_pages_that_the_code_names_exist() -> None:
    named = {
        (file, page)
        for file in FILES
        for page in re.findall(r"(?<![\w./])docs/[\w/.-]*\w", text_of(ROOT / file))
        if not (ROOT / page).exists()
    }
    assert named == set()


def test_the_index_lists_every_page_once() -> None:
    text = text_of(ROOT / "docs" / "README.md")
    linked = [(ROOT / "docs" / link).resolve() for link in re.findall(r"\]\(([^)#]+\.md)\)", text)]
    assert sorted(linked) == sorted([*(ROOT / "docs").glob("*/**/*.md"), ROOT / "bags" / "README.md"])


def test_every_page_belongs_to_one_of_four_kinds() -> None:
    kinds = {page.relative_to(ROOT / "docs").parts[0] for page in (ROOT / "docs").rglob("*.md")}
    assert kinds == {"README.md", "index.md", "tutorial", "how-to", "reference", "explanation"}


def test_the_readme_is_short() -> None:
    assert len(text_of(ROOT / "README.md").splitlines()) <= 250


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_lines_are_wrapped_and_list_items_are_short(page: Path) -> None:
    text = re.sub(r"^```.*?^```|<!-- parameters -->.*?<!-- /parameters -->", "", text_of(page), flags=RE_BLOCK)
    prose = [line for line in text.splitlines() if not line.startswith(("|", "!["))]
    assert [line for line in prose if len(line) > 120] == []
    items = re.findall(r"^(?:- |\d+\. ).*?(?=\n\s*\n|\n- |\n\d+\. |\Z)", "\n".join(prose), re.DOTALL | re.MULTILINE)
    assert [item[:60] for item in items if len(item.split()) > LONGEST_ITEM] == []


def test_the_page_of_quantities_lists_the_keys_of_the_json(capsys: pytest.CaptureFixture[str]) -> None:
    page = text_of(ROOT / "docs" / "reference" / "quantities.md")

    def documented(part: str) -> set[str]:
        (table,) = re.findall(rf"<!-- {part} -->(.*?)<!-- /{part} -->", page, re.DOTALL)
        cells = re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
        return {key for cell in cells for key in re.findall(r"`(\w+)`", cell)}

    assert command_line(["analyze", str(ROOT / "bags" / "samples" / "track_two_formation"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert documented("run") == set(found)
    assert documented("timestep") == set(found["timesteps"][0])
    assert documented("totals") == set(found["totals"])
    assert all(f"`{name}`" in page for name in found["conditions"])


def test_the_architectures_time_limits_are_the_watchdogs() -> None:
    limits = {name: p.default for name, p in inspect.signature(Watchdog).parameters.items() if name.endswith("_s")}
    page = text_of(ARCHITECTURE)
    for said, name in (
        ("(state T)", "stopped_s"),
        ("while others do", "silent_s"),
        ("never reported", "starting_s"),
        ("no robot does anything", "idle_s"),
    ):
        assert re.search(rf"^\|.*{re.escape(said)} \| {limits[name]:g} s", page, re.MULTILINE), name


def test_the_pages_of_the_fine_tuner_and_the_architecture_say_how_long_a_look_lasts() -> None:
    look = LookParameters()
    assert (look.frames, look.stable_frames, look.extra_frames, look.max_extensions) == (22, 3, 10, 3)
    fine_tuner = " ".join(text_of(NODE_PAGES / "fine_tuner.md").split())
    assert "A look lasts 22 frames" in fine_tuner
    assert "ten more, up to three times, while the last three frames do not" in fine_tuner
    architecture = " ".join(text_of(ARCHITECTURE).split())
    assert "`camera/request` for 22 frames" in architecture
    assert (
        "the last three frames report the same blocks; otherwise ten more frames are asked for, three times at most"
        in (architecture)
    )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_commands_of_a_page_are_understood(page: Path) -> None:
    """The command line's parser takes each `formation VERB ...` of a code block, as it stands there."""
    lines = [line for block in code_blocks(text_of(page).replace("\\\n", " ")) for line in block]
    commands = [line for line in lines if re.match(r"(\./)?formation (?!error)\w", line)]
    for command in commands:
        make_parser().parse_args(shlex.split(command)[1:])


@pytest.mark.slow
def test_the_run_that_the_readme_and_the_tutorial_show_is_what_a_run_gives() -> None:
    record = run_in_memory(override(load_track("two"), ["seed=3"]))
    report = text_report(record, analyse(record)).splitlines()
    tutorial = text_of(ROOT / "docs" / "tutorial" / "first_run.md").split("## 6.")[0]  # another run follows
    for text in (text_of(ROOT / "README.md"), tutorial):
        lines = [line for block in code_blocks(text) for line in block]
        figures = [line for line in lines if re.match(r" +\d+ .*\d\.\d\d|[a-z ]+  +\d", line)]
        assert len(figures) > 4
        assert [line for line in figures if line not in report and not line.startswith("timestep ")] == []


def test_the_papers_page_holds_the_defaults_of_mode_paper() -> None:
    p = AlignmentParameters()
    rules = text_of(ROOT / "docs" / "explanation" / "paper.md").split("## Rule table")[1].split("\n## ")[0]
    for said in (
        f"v back by {100 * p.coarse_step_m:g} cm",
        f"v forward by {100 * p.fine_step_m:g} cm",
        f"> {p.v_tolerance_px:g} px",
        f"> {100 * p.u_tolerance_m:g} cm",
        f"> {p.side_tolerance_px:g} px",
        f"turn by {round(math.degrees(p.turn_step_rad)):g} degrees",
        f"{100 * p.max_v_step_m:g} cm at most",
        f"After {p.max_moves} moves",
    ):
        assert said in rules


def test_the_page_of_real_robots_says_how_far_a_robot_may_be_sent() -> None:
    drive, tuner = DriveParameters(), FineTunerParameters()
    paper, planner = tuner.alignment, tuner.precise.approach
    text = " ".join(text_of(ROOT / "docs" / "how-to" / "real_robots.md").split())

    def cm(value_m: float) -> str:
        return f"{100 * value_m:g} cm"

    turn = round(math.degrees(drive.max_turn_rad))
    assert f"range ({cm(drive.max_v_m)}, {cm(drive.max_u_m)} sideways, {turn} degrees)" in text
    assert f"prediction moves are cut to {100 * tuner.max_v_m:g} and {cm(tuner.max_u_m)}" in text
    assert f"Corrections go up to {cm(planner.max_v_m)}, {cm(planner.max_u_m)} sideways" in text
    assert f"(`mode: paper`: {cm(max(paper.max_v_step_m, paper.max_u_step_m))})" in text


def test_the_fine_tuners_page_names_what_it_may_wait_for() -> None:
    (listed,) = re.findall(r"`waiting for` \((.*?)\)", text_of(NODE_PAGES / "fine_tuner.md").replace("\n", " "))
    assert set(re.findall(r"`(\w+)`", listed)) == {phase.name.lower() for phase in Phase}
