"""HTML as a tree of elements: what is put in as text comes out as text, whatever it holds.

The tree is `xml.etree.ElementTree`'s, whose HTML serialisation escapes texts and attributes and closes every element.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

Content = str | Element
"""What an element may hold: texts and elements."""


def element(tag: str, *contents: Content | None, **attributes: str) -> Element:
    """Make an element.

    Args:
        tag: its name.
        contents: in order; None is left out.
        attributes: `class_` stands for class, and an underscore inside a name for a hyphen.
    """
    made = Element(tag, {name.rstrip("_").replace("_", "-"): _clean(value) for name, value in attributes.items()})
    return fill(made, *contents)


def fill(parent: Element, *contents: Content | None) -> Element:
    """Append texts and elements to an element; return it."""
    for content in contents:
        if isinstance(content, Element):
            parent.append(content)
        elif content is not None:
            text = _clean(content)
            if len(parent):
                parent[-1].tail = (parent[-1].tail or "") + text
            else:
                parent.text = (parent.text or "") + text
    return parent


def section(title: str, *contents: Content | None, level: int = 2) -> Element:
    """Make a section with its heading."""
    return element("section", element(f"h{level}", title), *contents)


def paragraph(*contents: Content | None, **attributes: str) -> Element:
    """Make a paragraph."""
    return element("p", *contents, **attributes)


def table(caption: str, heads: Sequence[Content], rows: Sequence[Sequence[Content]], **attributes: str) -> Element:
    """Make a table in a box of its own that scrolls where the window is narrower; each row's first cell is its head."""
    top = element("tr", *(element("th", head, scope="col") for head in heads))
    body = [
        element("tr", element("th", first, scope="row"), *(element("td", cell) for cell in rest))
        for first, *rest in rows
    ]
    made = element("table", element("caption", caption), element("thead", top), element("tbody", *body), **attributes)
    return element("div", made, class_="scroll", tabindex="0", role="region", aria_label=caption)


def page_text(root: Element) -> str:
    """Return a whole page as text."""
    return "<!DOCTYPE html>\n" + ElementTree.tostring(root, encoding="unicode", method="html") + "\n"


def _clean(text: str) -> str:
    """Replace what no page may hold: control characters, and halves of a character that a file name may have."""
    if text.isascii() and text.isprintable():
        return text
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return "".join(sign if sign.isprintable() or sign.isspace() else "\N{REPLACEMENT CHARACTER}" for sign in whole)
