"""Text of a page between the comments <!-- NAME --> and <!-- /NAME -->, which a script writes."""

from __future__ import annotations

import re
from pathlib import Path

from robot_formation.errors import FormationError


def with_marked(path: Path, name: str, text: str) -> tuple[str, str]:
    """Return a page as it is, and as it is with another text between its marks.

    Raises:
        FormationError: if the page has no place for the text, or several.
    """
    page = path.read_text(encoding="utf-8")
    place = re.compile(rf"(<!-- {re.escape(name)} -->\n).*?(<!-- /{re.escape(name)} -->)", re.DOTALL)
    if len(place.findall(page)) != 1:
        raise FormationError(f"{path} needs <!-- {name} --> and <!-- /{name} --> once, each on its own line")
    return page, place.sub(lambda match: f"{match[1]}{text}\n{match[2]}", page)
