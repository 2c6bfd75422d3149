"""The page that a report is: one HTML file without anything from outside, for light and dark, wide and narrow."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

from robot_formation.errors import FormationError
from robot_formation.reporting.inline_svg import greys
from robot_formation.reporting.markup import element, page_text, paragraph
from robot_formation.system.files import check_writable, write_whole

MOST_BYTES = 5_000_000
"""Size of the largest page."""
_RESERVED = 200_000  # for what is around the sections

_DARK_TEXT, _DARK_GROUND = 0xE8, 0x19  # greys of the dark scheme

_STYLE = """
:root { color-scheme: light dark; --text: #1a1a1a; --back: #ffffff; --soft: #f3f4f6; --line: #d4d7dc;
  --quiet: #55595f; --link: #00568a; LIGHT }
@media (prefers-color-scheme: dark) { :root { --text: #e8e8e8; --back: #191919; --soft: #262626; --line: #41464e;
  --quiet: #aab0b8; --link: #7cc4ee; DARK } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 64rem; padding: 1rem 1.25rem 3rem; background: var(--back); color: var(--text);
  font: 1rem/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0.5rem 0; }
h2 { font-size: 1.3rem; margin: 2.2rem 0 0.6rem; border-bottom: 1px solid var(--line); padding-bottom: 0.2rem; }
h3 { font-size: 1.1rem; margin: 1.6rem 0 0.4rem; }
h4 { font-size: 1rem; margin: 1.2rem 0 0.3rem; }
p { max-width: 46rem; margin: 0.5rem 0; }
a { color: var(--link); }
.quiet, figcaption, caption { color: var(--quiet); font-size: 0.9rem; }
.answer { font-weight: 600; }
figure { margin: 1rem 0; }
iframe { display: block; width: 100%; height: 44rem; border: 1px solid var(--line); border-radius: 6px; }
.drawing svg { display: block; width: 100%; height: auto; max-width: 44rem; }
.scroll { overflow-x: auto; margin: 0.75rem 0; border: 1px solid var(--line); border-radius: 6px; }
.scroll:focus-visible { outline: 2px solid var(--link); }
table { border-collapse: collapse; width: 100%; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding: 0.4rem 0.6rem; }
th, td { padding: 0.25rem 0.6rem; text-align: right; vertical-align: top; border-top: 1px solid var(--line);
  white-space: nowrap; }
thead th { background: var(--soft); white-space: normal; vertical-align: bottom; }
tbody th { font-weight: normal; white-space: pre; }
th:first-child, table.words :is(th, td) { text-align: left; }
table.words td { white-space: normal; min-width: 7rem; }
pre { background: var(--soft); border: 1px solid var(--line); border-radius: 6px; padding: 0.6rem 0.8rem;
  overflow-x: auto; font-size: 0.85rem; margin: 0.5rem 0; }
dl.key { display: flex; flex-wrap: wrap; gap: 0.6rem; margin: 1rem 0; }
dl.key div { flex: 1 1 9rem; background: var(--soft); border-radius: 6px; padding: 0.5rem 0.8rem; }
dl.key dt { color: var(--quiet); font-size: 0.85rem; }
dl.key dd { margin: 0; font-size: 1.25rem; font-weight: 600; }
@media (max-width: 36rem) { body { padding: 0.5rem 0.75rem 2rem; } .drawing.wide svg { min-width: 34rem; }
  th, td { padding: 0.25rem 0.4rem; } tbody th { white-space: pre-wrap; min-width: 8rem; }
  table.steps tbody th { min-width: 0; } }
@media print { body { max-width: none; } .scroll { overflow: visible; } }
"""


class PageError(FormationError):
    """A page can't be written."""


class PageSpace:
    """Keeps a page below its largest size: tells what still fits."""

    def __init__(self, most_bytes: int = MOST_BYTES - _RESERVED) -> None:
        self._left = most_bytes

    def take(self, part: Element, otherwise: str) -> Element:
        """Return a part of the page, or a paragraph with a text in its place where it doesn't fit any more."""
        size = len(page_text(part).encode())
        if size > self._left:
            part = paragraph(otherwise, class_="quiet")
            size = len(page_text(part).encode())
        self._left -= size
        return part


def page(title: str, lead: str, sections: Sequence[Element]) -> str:
    """Return a page's text.

    Args:
        title: of the page.
        lead: a sentence below it.
        sections: what follows.
    """
    body = element("body", element("header", element("h1", title), paragraph(lead)), element("main", *sections))
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("link", rel="icon", href="data:,"),
        element("style", _style(greys(body))),
    )
    return page_text(element("html", head, body, lang="en"))


def write_page(make: Callable[[], str], path: Path) -> Path:
    """Write a page; an older file there is replaced, its folder is made if it is missing.

    Args:
        make: makes its text, once it is known that it can be written.
        path: where to.

    Raises:
        PageError: the file can't be written.
    """
    with _told(path):
        there = next(folder for folder in path.parents if folder.exists())
        check_writable(there / path.relative_to(there).parts[0])  # its folder is made with it
    text = make()
    with _told(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text.encode("utf-8"))
    return path


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise PageError(f"{path} can't be written: {error.strerror or error}; choose another --out") from error


def _style(used: Sequence[str]) -> str:
    """Return the style sheet with the figures' greys: in the dark scheme from light text to dark ground."""
    light = " ".join(f"--grey-{grey}: #{grey * 3};" for grey in used)
    dark = " ".join(f"--grey-{grey}: #{_in_the_dark(grey) * 3};" for grey in used)
    return _STYLE.replace("LIGHT", light).replace("DARK", dark)


def _in_the_dark(grey: str) -> str:
    """Return what a grey (two hexadecimal digits) is in the dark scheme: black is the text's, white the ground's."""
    share = int(grey, 16) / 0xFF
    return f"{round(_DARK_TEXT + (_DARK_GROUND - _DARK_TEXT) * share):02x}"
