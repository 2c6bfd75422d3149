"""Code and pages use the terms of docs/reference/glossary.md, and none of those that they have replaced."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from repository import PACKAGE, ROOT

REPLACED = {
    "surprise": "NIS",
    "misfit": "NIS",
    "handicap": "initial loss",
    "hulls": "bounding boxes",
    "trifle": "deadband",
    "clueless": "unknown-heading threshold",
    "vantage": "viewpoint",
    "strand": "hold",
    "sighting": "camera sample",
    "insight": "diagnostics",
    "lean": "relative tilt",
}
ENDINGS = r"(?:e?s|d|ed|ing)?"
WORD = re.compile(rf"\b(?:{'|'.join(REPLACED)}){ENDINGS}\b")
ESCAPE = re.compile(r"\\.")
CODE = sorted(
    file for folder in ("robot_formation", "test", "bench", "launch", "docs") for file in (ROOT / folder).rglob("*.py")
)
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "bags" / "README.md"]


def words(text: str) -> str:
    """Return a text with its identifiers taken apart: `pose_filter` and `PoseFilter` become `pose filter`."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|_", " ", text).lower()


def texts(source: str) -> Iterator[str]:
    """Yield the names, comments and sentences (docstrings and other strings with a space) of a Python file.

    Former names of parameters are strings of one word, which users may still write, and are left out by that.
    """
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.NAME, tokenize.COMMENT):
            yield token.string
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.value


def replaced_in(file: Path) -> set[str]:
    """Find the replaced words of a page or of a Python file."""
    source = file.read_text(encoding="utf-8")
    if not WORD.search(words(ESCAPE.sub(" ", source))):  # most files: to take one apart costs a hundred times as much
        return set()
    found = texts(source) if file.suffix == ".py" else [source]
    return {word for text in found for word in WORD.findall(words(text))}


def test_no_replaced_word_is_used() -> None:
    assert len(CODE) > 200
    assert len(PAGES) > 20
    found = {str(file.relative_to(ROOT)): replaced_in(file) for file in [*CODE, *PAGES]}
    assert {file: bad for file, bad in found.items() if bad} == {}


@pytest.mark.parametrize(
    "text", ["meanSurprise", "_CLUELESS_RAD", "box_hulls", "x.insights", "leaning", "slip_per_lean"]
)
def test_identifiers_and_inflections_are_found(text: str) -> None:
    assert WORD.search(words(text))


@pytest.mark.parametrize("text", ["clean", "boolean", "learn", "clean_up"])
def test_longer_words_are_not(text: str) -> None:
    assert not WORD.search(words(text))


def test_no_two_public_classes_of_the_package_have_one_name() -> None:
    """What `import robot_formation` offers has the plain names, whatever the rooms below call their own."""
    places: dict[tuple[bool, str], list[str]] = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                offered = file.parent.name == "api"
                places.setdefault((offered, node.name), []).append(file.relative_to(PACKAGE).as_posix())
    assert len(places) > 200
    assert {name: files for name, files in places.items() if len(files) > 1} == {}
