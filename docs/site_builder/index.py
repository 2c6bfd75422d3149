"""The index docs/README.md, from which the site takes its order: sections, and the pages that they list."""

from __future__ import annotations

import posixpath
import re
from dataclasses import dataclass
from pathlib import PurePosixPath

_LINK = re.compile(r"\]\(([^)\s#]+)\)")
ELSEWHERE = {
    "README.md": "index.md",
    "docs/README.md": "index.md",
    "bags/README.md": "reference/bags.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.rst": "changelog.rst",
}
"""Where the site has files of the checkout that are no pages of docs/."""


def page_of(file: str) -> str | None:
    """Return where the site has a file of the checkout, None if it has not; paths from the checkout and the site."""
    if file in ELSEWHERE:
        return ELSEWHERE[file]
    path = PurePosixPath(file)
    if path.parts[:1] != ("docs",) or path.suffix not in (".md", ".py", ".png", ".jpg", ".gif"):
        return None
    page = path.relative_to("docs")
    if path.suffix == ".py":  # tutorials are Python files; those beside conf.py are tools
        return page.with_suffix(".md").as_posix() if len(page.parts) == 2 else None
    return page.as_posix()


def slug(heading: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@dataclass(frozen=True)
class Section:
    """A section of the index: its heading, its text, the folder of its pages, and these, as paths in the site."""

    heading: str
    text: str
    folder: str
    pages: tuple[str, ...]


@dataclass(frozen=True)
class Index:
    """The sections that list pages, in order."""

    sections: tuple[Section, ...]

    @staticmethod
    def of(text: str) -> Index:
        """Read the index's Markdown."""
        found = []
        for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
            heading, _, body = part.partition("\n")
            files = [posixpath.normpath(f"docs/{link}") for link in _LINK.findall(body) if ":" not in link]
            pages = tuple(page for file in files if (page := page_of(file)))
            if pages:
                found.append(Section(heading.strip(), body.strip(), PurePosixPath(pages[0]).parts[0], pages))
        return Index(tuple(found))

    def page_of_section(self, anchor: str) -> str | None:
        """Return the page that the site has for the section with this anchor."""
        return next((f"{s.folder}/index.md" for s in self.sections if slug(s.heading) == anchor), None)
