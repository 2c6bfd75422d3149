"""BibTeX of the project and of the paper whose method it implements, made from CITATION.cff."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robot_formation.errors import FormationError
from robot_formation.json_values import Json, JsonObject
from robot_formation.paths import share_dir
from robot_formation.system.yaml_files import read_yaml

ARXIV = "https://arxiv.org/abs/2205.04052"
"""The paper."""

_SPECIAL = str.maketrans({sign: f"\\{sign}" for sign in "_&%#$"})


def bibtex() -> str:
    """Return the entries.

    Raises:
        FormationError: if CITATION.cff is missing or damaged.
    """
    path = share_dir() / "CITATION.cff"
    remedy = "install robot_formation again"
    content = read_yaml(path, refuse=FormationError, remedy=remedy)
    try:
        return "\n".join(_entries(content))  # type: ignore[arg-type]
    except (KeyError, TypeError, AttributeError, IndexError):
        raise FormationError(f"{path} is no citation file; {remedy}") from None


def _entries(content: JsonObject) -> list[str]:
    name = str(content["title"]).partition(":")[0]
    authors = {"title": content["title"], "author": _authors(content["authors"])}
    software = _entry("software", name, {**authors, "version": content["version"], "license": content["license"]})
    return [software, *(_article(reference) for reference in content["references"])]


def _article(reference: Mapping[str, Json]) -> str:
    first = reference["authors"][0]["family-names"].lower()
    word = reference["title"].split()[0].lower()
    (number,) = (each["value"] for each in reference["identifiers"])
    fields = {
        "title": reference["title"],
        "author": _authors(reference["authors"]),
        "journal": f"{reference['journal']} {number}",
        "year": reference["year"],
        "doi": reference["doi"],
    }
    return _entry("article", f"{first}{reference['year']}{word}", fields)


def _authors(authors: Sequence[Mapping[str, str]]) -> str:
    # A second pair of braces keeps the name of a group together.
    names = [f"{each['family-names']}, {each['given-names']}" if "given-names" in each else None for each in authors]
    return " and ".join(name or f"{{{each['name']}}}" for name, each in zip(names, authors, strict=True))


def _entry(kind: str, key: str, fields: Mapping[str, Json]) -> str:
    width = max(map(len, fields))
    lines = [f"  {name.ljust(width)} = {{{_value(name, value)}}}" for name, value in fields.items()]
    return "\n".join([f"@{kind}{{{key},", ",\n".join(lines), "}"])


def _value(name: str, value: Json) -> str:
    text = str(value)
    if name == "doi":
        return text
    text = text.translate(_SPECIAL)
    return text.replace("Koopman", "{Koopman}") if name == "title" else text
