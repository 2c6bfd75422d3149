"""The example on the Koopman page runs and prints what its comments say; its table names what exists."""

import ast
import re
from pathlib import Path
from typing import Any

import pytest

import robot_formation.koopman as koopman
from repository import ROOT

PAGE = (ROOT / "docs" / "explanation" / "koopman.md").read_text()


def found(pattern: str, text: str) -> str:
    """What the pattern's group matches."""
    match = re.search(pattern, text, re.DOTALL | re.MULTILINE)
    assert match, pattern
    return match[1]


def test_the_example_runs_and_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    code = found(r"```python\n(.*?)```", PAGE)
    names: dict[str, Any] = {}
    exec(compile(code, "docs/explanation/koopman.md", "exec"), names)
    printed = capsys.readouterr().out
    stated = found(r"# (\[[^]]*\]): mu, 2 mu, lam", code)
    assert printed.startswith(stated)
    assert names["model"].training_errors.state < 1e-12


def test_the_estimators_example_runs_and_prints_what_it_says(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[1]
    names: dict[str, Any] = {}
    exec(compile(code, "docs/explanation/koopman.md", "exec"), names)
    assert capsys.readouterr().out.splitlines() == re.findall(r"^print.*  # (.*)$", code, re.MULTILINE)
    assert names["X"].shape == names["y"].shape == (54, 1)
    assert len(names["groups"]) == 54
    assert sorted(path.name for path in tmp_path.iterdir()) == ["modes.png", "spectrum.png"]


def test_the_page_names_the_whole_public_interface() -> None:
    for name in koopman.__all__:
        assert f"`{name}" in PAGE or name in ("Errors", "KoopmanError", "Regularization", "Spectrum"), name


def test_the_members_it_lists_exist() -> None:
    row = found(r"^\| `EDMD` \| ([^\n]*) \|$", PAGE)
    members = [ast.parse(text, mode="eval").body for text in re.findall(r"`([^`]+)`", row)]
    names = [ast.unparse(member.func if isinstance(member, ast.Call) else member) for member in members]
    annotations = koopman.EDMD.__annotations__
    assert [name for name in names if not hasattr(koopman.EDMD, name) and name not in annotations] == []
