"""Sphinx extension of the documentation site: pages that the checkout has elsewhere, the API's pages, and links.

The Markdown pages of docs/ are written for a reader of the repository, with relative links to files. Beside them the
site has pages made when it is built: one for each section of the index docs/README.md, some sections of README.md,
files from outside docs/, the tutorials that are Python files, the command line's help, and one for each public name.
They are written into Sphinx's source folder, as autosummary does; docs/build_site.py gives it a copy of docs/.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from sphinx.application import Sphinx
from sphinx.util.inspect import TypeAliasForwardRef

from site_builder.api_pages import api_pages
from site_builder.command_line import command_line_page
from site_builder.diagrams import without_diagrams
from site_builder.docstrings import plain_text
from site_builder.index import Index
from site_builder.links import Links
from site_builder.pages import pages_from_files


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx; values of conf.py: `project_root`, and `project_url`, empty if there is none."""
    app.add_config_value("project_root", "", "env", str)
    app.add_config_value("project_url", "", "env", str)
    app.connect("builder-inited", _write_pages)
    app.connect("source-read", _rewrite)
    app.connect("autodoc-process-docstring", plain_text, priority=400)  # before napoleon's
    # Sphinx writes an alias that is part of a union as TypeAliasForwardRef('Matrix').
    TypeAliasForwardRef.__repr__ = lambda self: str(self.name)  # type: ignore[method-assign]
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _links(app: Sphinx) -> Links:
    root = Path(app.config.project_root)
    return Links(root, app.config.project_url, Index.of((root / "docs" / "README.md").read_text(encoding="utf-8")))


def _write_pages(app: Sphinx) -> None:
    root, links = Path(app.config.project_root), _links(app)
    mocked = app.config.autodoc_mock_imports
    api = api_pages(mocked)
    pages = {**pages_from_files(root, links, api), **api, **command_line_page(root, links, mocked)}
    for name, text in pages.items():
        path = Path(app.srcdir, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # an unchanged page is not read again
            path.write_text(text, encoding="utf-8")
    app.project.discover(app.config.exclude_patterns)


def _rewrite(app: Sphinx, name: str, source: list[str]) -> None:
    page = PurePosixPath(app.env.doc2path(name, base=False))
    if page.suffix == ".md":
        source[0] = without_diagrams(_links(app).rewritten(source[0], PurePosixPath("docs") / page, page))
