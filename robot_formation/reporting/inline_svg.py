"""Figures as part of a page: SVG whose ids are the figure's own and whose greys follow the page's light or dark scheme.

Texts stay texts, so that they can be read aloud, searched and drawn with the page's font.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from robot_formation.reporting.markup import element

_SVG = "{http://www.w3.org/2000/svg}"
_LINK = "{http://www.w3.org/1999/xlink}href"
_GREY = re.compile(r"#([0-9a-f]{2})\1\1(?![0-9a-f])", re.IGNORECASE)
_REFERENCE = re.compile(r"url\(#([^)]+)\)")
_NO_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")  # in names of scenarios, say
_DROPPED = ("metadata", "style")  # links to vocabularies, and a rule that would hold for the whole page


def figure(
    name: str, draw: Callable[[Path], object], folder: Path, *, title: str, caption: str, wide: bool = False
) -> Element:
    """Draw a figure and return it as an element of a page.

    Args:
        name: unique in the page; a word.
        draw: draws the figure into a file.
        folder: where that file is put for the moment.
        title: what the figure shows, for those who don't see it.
        caption: text below the figure.
        wide: whether its texts are too small to be read when it is shrunk to a phone's width; it scrolls there.
    """
    from matplotlib import rc_context

    path = folder / f"{name}.svg"
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        draw(path)
    drawing = inlined(path.read_text(encoding="utf-8"), name)
    path.unlink()
    drawing.insert(0, element("title", title, id=f"{name}-title"))
    drawing.set("role", "img")
    drawing.set("aria-labelledby", f"{name}-title")
    box = element("div", drawing, class_="scroll drawing wide" if wide else "drawing")
    if wide:
        box.set("tabindex", "0")
    return element("figure", box, element("figcaption", caption), id=name)


def inlined(svg: str, name: str) -> Element:
    """Return an SVG document as an element of a page.

    Args:
        svg: the document, as matplotlib writes it.
        name: goes before its ids, which have to be unique in the page.
    """
    root = ElementTree.fromstring(_NO_XML.sub("\N{REPLACEMENT CHARACTER}", svg))
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in [f"{_SVG}{tag}" for tag in _DROPPED]:
                parent.remove(child)
    for node in root.iter():
        node.tag = node.tag.removeprefix(_SVG)
        node.attrib = {
            key: _own(key, text, name)
            for key, text in node.attrib.items()
            if not key.startswith("{http") or key == _LINK
        }
        if _LINK in node.attrib:
            node.set("href", node.attrib.pop(_LINK))
    for key in ("width", "height", "version"):  # the page gives the size, the view box the shape
        root.attrib.pop(key, None)
    # As in the style that was dropped; and what has no colour is black.
    root.set("style", "stroke-linejoin: round; stroke-linecap: butt; fill: var(--grey-00)")
    return root


def _own(key: str, text: str, name: str) -> str:
    """Return an attribute's text with the figure's ids and the page's greys."""
    if key == "id":
        return f"{name}-{text}"
    if key in (_LINK, "href"):
        return f"#{name}-{text[1:]}" if text.startswith("#") else text
    text = _REFERENCE.sub(rf"url(#{name}-\1)", text)
    return _GREY.sub(lambda match: f"var(--grey-{match[1].lower()})", text) if key == "style" else text


def greys(root: Element) -> list[str]:
    """List the greys that figures of a page use, as two hexadecimal digits each."""
    found = {grey for node in root.iter() for grey in re.findall(r"var\(--grey-(\w\w)\)", node.get("style", ""))}
    return sorted(found)
