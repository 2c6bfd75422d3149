"""CITATION.cff credits the software, and the paper as a reference; the README's BibTeX says the same."""

import re

import yaml

import robot_formation
from repository import ROOT

CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_the_software_is_what_is_cited() -> None:
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] == "software"
    assert CITATION["authors"] == [{"name": "robot_formation maintainers"}]
    assert CITATION["version"] == robot_formation.__version__
    assert CITATION["license"] == "Apache-2.0"
    assert CITATION["title"].startswith("robot_formation")
    assert CITATION["message"]
    # Sites show the preferred citation in place of the software.
    assert "preferred-citation" not in CITATION


def test_the_paper_is_a_reference() -> None:
    (paper,) = CITATION["references"]
    assert paper["type"] == "article"
    assert [author["family-names"] for author in paper["authors"]] == ["Wang", "Baba", "Hikihara"]
    assert paper["doi"] == "10.48550/arXiv.2205.04052"
    assert paper["year"] == 2022


def test_the_readme_has_bibtex_of_both() -> None:
    (text,) = re.findall(r"```bibtex\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    software, paper = (part for part in re.split(r"(?=^@)", text, flags=re.MULTILINE) if part)
    assert software.startswith("@software{")
    assert f"{{{CITATION['version']}}}" in software
    assert paper.startswith("@article{")
    reference = CITATION["references"][0]
    assert reference["doi"] in paper
    for author in reference["authors"]:
        assert f"{author['family-names']}, {author['given-names']}" in paper

    def plain(title: str) -> str:
        return re.sub(r"[{}\\\\]", "", title)

    assert plain(re.findall(r"title += \{(.*)\},", paper)[0]) == reference["title"]
    assert plain(re.findall(r"title += \{(.*)\},", software)[0]) == CITATION["title"]
