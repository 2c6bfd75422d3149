"""Pages of the site that are made of files: the index's sections, sections of README.md, and files beside docs/."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from site_builder.index import ELSEWHERE, Section, slug
from site_builder.links import README_PAGES, Links
from site_builder.percent import markdown_of

_API = "- {doc}`api/index`: every public name, its signature and docstring.\n"


def pages_from_files(root: Path, links: Links, more: Iterable[str]) -> dict[str, str]:
    """Make the pages: text by path in the site.

    Args:
        root: folder of the checkout.
        links: rewrites links.
        more: pages made elsewhere, of which the folders' indexes belong to the section of their folder.
    """
    pages = {}
    for file, page in ELSEWHERE.items():
        if page != "index.md":
            pages[page] = _page(root, links, file, page)
    lessons = _lessons(root, links)
    pages.update(lessons)
    own = {page: readme_section(root, links, anchor, page) for anchor, page in README_PAGES.items()}
    own["reference/nodes/index.md"] += _toctree("reference/nodes", _all_pages(links))
    pages.update(own)
    for section in links.index.sections:
        page = f"{section.folder}/index.md"
        text = f"# {section.heading}\n\n{_section_text(section, links, page)}\n"
        text += _API if section.folder == "reference" else ""
        pages[page] = text + _toctree(section.folder, [*section.pages, *lessons, *own, *more])
    return pages


def _lessons(root: Path, links: Links) -> dict[str, str]:
    """Make pages of the tutorials that are Python files of cells, in the order in which a page beside them has them."""
    files = [file for file in sorted((root / "docs" / "tutorial").glob("*.py")) if "# %%" in file.read_text("utf-8")]
    listed = "".join(page.read_text("utf-8") for page in sorted((root / "docs" / "tutorial").glob("*.md")))
    pages = {}
    for file in sorted(files, key=lambda file: listed.find(file.name)):
        page = f"tutorial/{file.stem}.md"
        source = PurePosixPath("docs", "tutorial", file.name)
        pages[page] = _written(links, markdown_of(file.read_text("utf-8")), source, page)
    return pages


def readme_section(root: Path, links: Links, anchor: str, page: str) -> str:
    """Return a section of README.md as a page."""
    for part in re.split(r"^## ", (root / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        if slug(heading.strip()) == anchor:
            return _written(links, f"# {heading}\n\n{body.strip()}\n", PurePosixPath("README.md"), page)
    raise ValueError(f"README.md has no section '{anchor}'")


def _page(root: Path, links: Links, file: str, page: str) -> str:
    text = (root / file).read_text(encoding="utf-8")
    return _written(links, text, PurePosixPath(file), page) if page.endswith(".md") else text


def _written(links: Links, text: str, file: PurePosixPath, page: str) -> str:
    return links.rewritten(text, file, PurePosixPath(page))


def _section_text(section: Section, links: Links, page: str) -> str:
    return _written(links, section.text, PurePosixPath("docs/README.md"), page)


def _all_pages(links: Links) -> list[str]:
    return [page for section in links.index.sections for page in section.pages]


def _toctree(folder: str, pages: Iterable[str]) -> str:
    """List the pages of a folder, and of its sub-folders only their indexes, for the site's navigation."""
    inside = [PurePosixPath(page) for page in pages if PurePosixPath(page).is_relative_to(folder)]
    entries = []
    for page in inside:
        below = page.relative_to(folder)
        entry = below if len(below.parts) == 1 else PurePosixPath(below.parts[0], "index")
        if entry.name != "index" or len(below.parts) > 1:
            entries.append(entry.with_suffix("").as_posix())
    lines = "\n".join(dict.fromkeys(entries))
    return f"\n```{{toctree}}\n:hidden:\n\n{lines}\n```\n"
