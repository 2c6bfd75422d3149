"""The example on the Koopman page runs and prints what its comments say; its table names what exists."""

import ast
import re

import robot_formation.koopman as koopman
from repository import ROOT

PAGE = (ROOT / "docs" / "explanation" / "koopman.md").read_text()


def test_the_example_runs_and_prints_what_it_says(capsys):
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)[1]
    names = {}
    exec(compile(code, "docs/explanation/koopman.md", "exec"), names)
    printed = capsys.readouterr().out
    stated = re.search(r"# (\[[^]]*\]): mu, 2 mu, lam", code)[1]
    assert printed.startswith(stated)
    assert names["model"].training_errors.state < 1e-12


def test_the_page_names_the_whole_public_interface():
    for name in koopman.__all__:
        assert f"`{name}" in PAGE or name in ("Errors", "KoopmanError", "Regularization", "Spectrum"), name


def test_the_members_it_lists_exist():
    row = re.search(r"^\| `EDMD` \| (.*) \|$", PAGE, re.MULTILINE)[1]
    members = [ast.parse(text).body[0].value for text in re.findall(r"`([^`]+)`", row)]
    names = [member.func.id if isinstance(member, ast.Call) else member.id for member in members]
    annotations = koopman.EDMD.__annotations__
    assert [name for name in names if not hasattr(koopman.EDMD, name) and name not in annotations] == []
