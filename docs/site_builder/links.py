"""Links of the Markdown pages: relative to files of the checkout on GitHub, to pages in the site."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from types import MappingProxyType

from site_builder.index import Index, page_of

README_PAGES: Mapping[str, str] = MappingProxyType(
    {
        "commands": "reference/command_line.md",
        "nodes": "reference/nodes/index.md",
        "limits": "explanation/limits.md",
    }
)
"""Sections of README.md that are pages of the site, by their anchors."""

_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
_FENCED = re.compile(r"(^ *```.*?^ *```[^\n]*$)", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Links:
    """Rewrites links.

    Attributes:
        root: folder of the checkout.
        url: of the project's repository on GitHub, or empty.
        index: the sections of docs/README.md.
    """

    root: Path
    url: str
    index: Index

    def rewritten(self, text: str, source: PurePosixPath, page: PurePosixPath) -> str:
        """Return Markdown whose links hold in the site.

        Args:
            text: the Markdown; code blocks stay as they are.
            source: the file that it is from, as a path from the checkout.
            page: the page that it is for, as a path from the site's root.
        """
        parts = _FENCED.split(text)
        parts[::2] = [_LINK.sub(lambda match: self._link(match, source, page), part) for part in parts[::2]]
        return "".join(parts)

    def _link(self, match: re.Match[str], source: PurePosixPath, page: PurePosixPath) -> str:
        mark, text, link = match.groups()
        path, hash_, anchor = link.partition("#")
        if re.match(r"[a-z]+:", link) or not path:
            return match[0]
        file = posixpath.normpath(posixpath.join(source.parent.as_posix(), path))
        target = self._section(file, anchor)
        if target is None and (target := page_of(file)) is not None and target != "index.md":
            target += hash_ + anchor  # the start page has none of the sections of the READMEs
        if target is not None:
            return f"{mark}[{text}]({posixpath.relpath(target, page.parent.as_posix())})"
        if not self.url:
            return text
        kind = "tree" if (self.root / file).is_dir() else "blob"
        return f"{mark}[{text}]({self.url}/{kind}/main/{file}{hash_}{anchor})"

    def _section(self, file: str, anchor: str) -> str | None:
        if file == "README.md":
            return README_PAGES.get(anchor)
        if file == "docs/README.md":
            return self.index.page_of_section(anchor)
        return None
