"""The documentation site: built without a warning, a network, ROS and PyBullet; complete, and whole by itself."""

import contextlib
import importlib
import io
import posixpath
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

import pytest
import yaml

from chromium import Chromium
from repository import ROOT
from robot_formation.cli.main import main as command_line

for needed in ("furo", "myst_parser", "sphinx"):
    pytest.importorskip(needed)

from site_builder.api_pages import public_names  # noqa: E402
from site_builder.diagrams import without_diagrams  # noqa: E402
from site_builder.docstrings import plain_text  # noqa: E402
from site_builder.index import Index  # noqa: E402
from site_builder.links import Links  # noqa: E402
from site_builder.percent import markdown_of  # noqa: E402

TOUR = ROOT / "docs" / "tutorial" / "five_minute_tour.md"
# Runs the command as in an environment without ROS, PyBullet and network.
ALONE = """
import runpy, socket, sys
def refuse(*arguments):
    raise AssertionError("the site's build asks the network")
socket.socket.connect = socket.create_connection = socket.getaddrinfo = refuse
for name in ("rclpy", "pybullet"):
    sys.modules[name] = None
sys.argv = ["docs/build_site.py", "--out", sys.argv[1]]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site; the build ends with an error on any warning."""
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run([sys.executable, "-c", ALONE, str(out)], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    assert done.stdout == f"site: {out / 'index.html'}\n"
    return out


class Page(HTMLParser):
    """Addresses and anchors of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = {name: value for name, value in attrs if value is not None}
        self.anchors |= {said[name] for name in ("id", "name") if name in said}
        if tag == "a" and "href" in said:
            self.links.append(said["href"])
        else:
            self.loaded += [said[name] for name in ("href", "src") if name in said]


def inventory(site: Path) -> dict[str, str]:
    """Names and addresses of Python objects, of Sphinx's objects.inv: four lines of text, then compressed ones."""
    packed = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    found = {}
    for line in zlib.decompress(packed).decode().splitlines():
        name, kind, _, address, _ = line.split(" ", 4)
        if kind.startswith("py:"):
            found[name] = address.replace("$", name)
    return found


@pytest.mark.long
@pytest.mark.xdist_group("docs_site")
@pytest.mark.parametrize("module", ["robot_formation", "robot_formation.koopman", "robot_formation.testing"])
def test_every_public_name_has_a_page(site: Path, module: str) -> None:
    names = public_names(importlib.import_module(module))
    assert len(names) > 3
    found = inventory(site)
    assert [name for name in names if f"{module}.{name}" not in found] == []
    pages = {found[f"{module}.{name}"].partition("#")[0] for name in names}
    assert len({page.lower() for page in pages}) == len(names)
    assert all((site / page).is_file() for page in pages)


@pytest.mark.long
@pytest.mark.xdist_group("docs_site")
def test_every_page_of_the_folders_is_in_the_site(site: Path) -> None:
    docs = ROOT / "docs"
    pages = [page.relative_to(docs) for page in docs.rglob("*.md") if page != docs / "README.md"]
    assert len(pages) > 40
    assert [page for page in pages if not (site / page.with_suffix(".html")).is_file()] == []
    for made in ("reference/bags", "reference/command_line", "explanation/limits", "contributing", "changelog"):
        assert (site / f"{made}.html").is_file()


@pytest.mark.long
@pytest.mark.xdist_group("docs_site")
def test_links_lead_somewhere_and_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    pages = {file.relative_to(site).as_posix(): Page(file) for file in site.rglob("*.html")}
    broken = []
    for name, page in pages.items():
        for link in [*page.links, *page.loaded]:
            path, _, anchor = unquote(link).partition("#")
            path = path.partition("?")[0]
            if re.match(r"(https?|mailto):|//", link):
                broken += [(name, link)] if link in page.loaded else []
                continue
            target = posixpath.normpath(posixpath.join(posixpath.dirname(name), path)) if path else name
            if target in pages:
                there = not anchor or anchor in pages[target].anchors
            else:
                there = link.startswith("data:") or (site / target).is_file()
            broken += [] if there else [(name, link)]
    assert broken == []
    for file in site.rglob("*.css"):
        assert not re.search(r"@import|url\(\s*['\"]?(?:https?:)?//", file.read_text(encoding="utf-8")), file


@pytest.mark.long
@pytest.mark.xdist_group("docs_site")
def test_pages_fit_a_narrow_screen(site: Path, tmp_path: Path) -> None:
    with Chromium(tmp_path) as browser:
        for page in (
            "index",
            "reference/nodes/world",
            "reference/command_line",
            "reference/api/robot_formation.Follower",
        ):
            browser.open((site / f"{page}.html").as_uri())
            browser.until(f"document.readyState === 'complete' && location.href.endsWith('{page}.html')")
            width, shown = browser.value("[document.documentElement.scrollWidth, window.innerWidth]") or (1, 0)
            assert width <= shown, page
        assert browser.errors == []
        assert browser.requests
        assert [request for request in browser.requests if not request.startswith("file:")] == []


def test_rosdoc2_finds_the_site() -> None:
    name = ElementTree.parse(ROOT / "package.xml").findtext("export/rosdoc2")
    _, content = yaml.safe_load_all((ROOT / str(name)).read_text())
    (folder,) = [builder["sphinx"]["sphinx_sourcedir"] for builder in content["builders"]]
    assert (ROOT / folder / "conf.py").is_file()


INDEX = Index.of(
    "# Docs\n## How-to guides\n- [A](how-to/a.md)\n\n## Reference\n- [B](reference/deep/b.md)\n## Tools\nno pages\n"
)


@pytest.mark.parametrize(
    ("link", "in_site"),
    [
        ("../reference/deep/b.md#x", "[text](../reference/deep/b.md#x)"),
        ("../README.md", "[text](../index.md)"),
        ("../README.md#how-to-guides", "[text](index.md)"),
        ("../../README.md", "[text](../index.md)"),
        ("../../README.md#limits", "[text](../explanation/limits.md)"),
        ("../../bags/README.md#samples", "[text](../reference/bags.md#samples)"),
        ("../tutorial/first.py", "[text](../tutorial/first.md)"),
        ("https://arxiv.org/abs/2205.04052", "[text](https://arxiv.org/abs/2205.04052)"),
        ("#here", "[text](#here)"),
        ("../../setup.py", "text"),
        ("../make_parameter_tables.py", "text"),
    ],
)
def test_links_of_the_pages_hold_in_the_site(link: str, in_site: str) -> None:
    where = PurePosixPath("docs", "how-to", "a.md"), PurePosixPath("how-to", "a.md")
    code = f"\n```\n[text]({link})\n```\n"
    found = Links(ROOT, "", INDEX).rewritten(f"[text]({link}){code}", *where)
    assert found == in_site + code


@pytest.mark.parametrize(("file", "kind"), [("setup.py", "blob"), ("config/tags", "tree")])
def test_links_to_code_lead_to_the_repository_if_there_is_one(file: str, kind: str) -> None:
    links = Links(ROOT, "https://example.invalid/it", INDEX)
    found = links.rewritten(f"[text]({file})", PurePosixPath("CONTRIBUTING.md"), PurePosixPath("contributing.md"))
    assert found == f"[text](https://example.invalid/it/{kind}/main/{file})"


def test_the_index_gives_sections_with_their_pages() -> None:
    assert [(s.heading, s.folder, s.pages) for s in INDEX.sections] == [
        ("How-to guides", "how-to", ("how-to/a.md",)),
        ("Reference", "reference", ("reference/deep/b.md",)),
    ]


def test_diagrams_are_tables_of_their_arrows() -> None:
    boxes = 'flowchart LR\n  a["first"]\n  subgraph g["/robot"]\n    b["second"]\n  end\n'
    flow = boxes + '  a -- "say" --> b\n  b --> c["third"]\n'
    assert without_diagrams(f"```mermaid\n{flow}```\nText\n") == (
        "| from | by | to |\n|---|---|---|\n| first | say | /robot/second |\n| /robot/second |  | third |\n\nText\n"
    )
    states = "stateDiagram-v2\n  [*] --> A\n  A --> [*]: tick\n"
    assert "| (start) |  | A |\n| A | tick | (end) |" in without_diagrams(f"```mermaid\n{states}```\n")


@pytest.mark.parametrize("arrow", ["a --> b --> c", "a -.-> b", "a ==> b", "a --- b", "a -->|by| b"])
def test_an_arrow_that_would_be_missing_in_the_table_is_refused(arrow: str) -> None:
    with pytest.raises(ValueError, match="can't read this arrow"):
        without_diagrams(f"```mermaid\nflowchart LR\n  {arrow}\n```\n")


def test_every_arrow_of_the_pages_diagrams_is_in_their_tables() -> None:
    texts = [page.read_text() for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]]
    diagram = re.compile(r"^```mermaid\n.*?^```$", re.DOTALL | re.MULTILINE)
    diagrams = [found for text in texts for found in diagram.findall(text)]
    assert diagrams
    for drawn in diagrams:
        assert without_diagrams(drawn).count("\n| ") == drawn.count("-->"), drawn


def test_tutorials_in_python_become_text_and_code() -> None:
    source = "# ---\n# jupyter: x\n# ---\n\n# %% [markdown]\n# # Title\n#\n# Text.\n\n# %%\nx = 1\n\n# a comment\nx\n"
    assert markdown_of(source) == "# Title\n\nText.\n\n```python\nx = 1\n\n# a comment\nx\n```\n"


def test_docstrings_are_plain_text() -> None:
    lines = [
        "The norm |x| of `a|b_`, coef_:",
        "",
        "    y = |x|",
        "",
        "and on",
        "",
        "    z",
        "",
        "Args:",
        "    x: |it|.",
    ]
    plain_text(None, "", "", None, None, lines)  # type: ignore[arg-type]
    assert lines == [
        *("The norm \\|x\\| of `a|b_`, coef\\_::", "", "    y = |x|", "", "and on", "", "::", "", "    z", ""),
        *("Args:", "    x: \\|it\\|."),
    ]


def blocks_of(section: str) -> Iterator[tuple[str, list[str]]]:
    """The code blocks of a section: what it says beside the opening mark, and its lines."""
    for name, body in re.findall(r"^```(\w*)\n(.*?)^```", section, re.DOTALL | re.MULTILINE):
        yield name, body.splitlines()


@pytest.mark.slow
def test_the_tour_shows_what_its_commands_print(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each command or snippet of the tour is carried out, and prints the lines of the block after it."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "bags" / "samples", tmp_path / "bags" / "samples")  # pictures are written beside a bag
    checked = 0
    for section in TOUR.read_text(encoding="utf-8").split("\n## ")[1:-1]:
        (kind, typed), *shown = blocks_of(section)
        if "animate" in typed[0]:
            continue
        printed = run_code(typed) if kind == "python" else run_commands("\n".join(typed))
        for _, lines in shown:
            assert [line for line in lines if line not in printed] == []
            checked += len(lines)
    assert checked > 20


def run_code(lines: list[str]) -> list[str]:
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile("\n".join(lines), TOUR.name, "exec"), {})
    return output.getvalue().splitlines()


def run_commands(text: str) -> list[str]:
    """Carry out `./formation` in this process, and what makes a file of it with Python's own means."""
    made = re.search(r'^python3 -c "\n(.*?)" > (\S+)$', text, re.DOTALL | re.MULTILINE)
    if made:
        Path(made[2]).write_text("\n".join(run_code(made[1].splitlines())) + "\n")
    (command,) = re.findall(r"^\./formation (.*)$", text.replace("\\\n", " "), re.MULTILINE)
    arguments = command.split()
    if arguments[0] == "run":
        arguments += ["--bag", "first"]
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        assert command_line(arguments) == 0
    return output.getvalue().splitlines()
