"""The tutorials run as scripts and become notebooks; what their text claims, they assert themselves."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from repository import ROOT

FOLDER = ROOT / "docs" / "tutorial"
TUTORIALS = sorted(FOLDER.glob("*.py"))


@pytest.mark.long
@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda file: file.stem)
def test_a_tutorial_runs_as_a_script(tutorial: Path, tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    command = [sys.executable, "-W", "error::UserWarning", str(tutorial)]
    completed = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert completed.returncode == 0, completed.stderr
    drawn = set(re.findall(r'savefig\("(\w+\.png)"\)', tutorial.read_text(encoding="utf-8")))
    assert drawn
    assert drawn <= {file.name for file in tmp_path.iterdir()}


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda file: file.stem)
def test_a_tutorial_becomes_a_valid_notebook(tutorial: Path) -> None:
    jupytext = pytest.importorskip("jupytext")
    nbformat = pytest.importorskip("nbformat")
    notebook = jupytext.reads(tutorial.read_text(encoding="utf-8"), fmt="py:percent")
    nbformat.validate(nbformat.reads(jupytext.writes(notebook, fmt="ipynb"), as_version=4))
    first, *others = notebook.cells
    assert first.cell_type == "markdown"
    assert first.source.startswith("# ")
    assert sum(cell.cell_type == "code" for cell in others) > 4
    assert "assert " in "".join(cell.source for cell in others)
    assert notebook.metadata.kernelspec.name == "python3"


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda file: file.stem)
def test_links_of_a_tutorial_lead_somewhere_and_lines_are_short(tutorial: Path) -> None:
    text = tutorial.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)\s#]+)(?:#[^)]*)?\)", text)
    assert links
    assert [link for link in links if not (FOLDER / link).exists()] == []
    assert [line for line in text.splitlines() if len(line) > 120] == []


def test_the_page_lists_every_tutorial_and_exercise_page() -> None:
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    expected = {file.name for file in FOLDER.iterdir() if file.suffix in (".py", ".md")} - {"README.md"}
    assert set(re.findall(r"\]\(([\w.]+)\)", page)) >= expected


def test_the_class_of_the_tutorial_is_as_short_as_its_title_says() -> None:
    text = (FOLDER / "your_predictor.py").read_text(encoding="utf-8")
    body = text.split('erred less."""\n')[1].split("\n\n\n# %%")[0]
    assert len([line for line in body.splitlines() if line.strip()]) <= 20
