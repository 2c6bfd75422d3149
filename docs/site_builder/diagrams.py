"""Mermaid diagrams, which GitHub draws: in the site their arrows are a table, since drawing needs a foreign script."""

from __future__ import annotations

import re

_DIAGRAM = re.compile(r"^```mermaid\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NODE = r'(\[\*\]|\w+)(?:\["([^"]*)"\])?'
_ARROW = re.compile(rf' *{_NODE}(?: -- "([^"]*)")? --> {_NODE}(?:: (.*))?')
_BOX = re.compile(rf" *{_NODE}")
_SOME_ARROW = re.compile("->|=>|---|===")
_GROUP = re.compile(r' *subgraph \w+\["([^"]*)"\]')


def without_diagrams(text: str) -> str:
    """Return Markdown in which each Mermaid diagram is a table of its arrows."""
    return _DIAGRAM.sub(lambda match: _table(match[1]), text)


def _table(diagram: str) -> str:
    """List the arrows; a box in a group, like a namespace, has the group's name before its own.

    Raises:
        ValueError: if an arrow is written in a way that is not known here.
    """
    labels: dict[str, str] = {}
    arrows, group = [], ""
    for line in diagram.splitlines():
        if match := _GROUP.fullmatch(line):
            group = f"{match[1]}/"
        elif line.strip() == "end":
            group = ""
        elif match := _ARROW.fullmatch(line):
            source, source_label, before, target, target_label, after = match.groups()
            arrows.append((source, before or after or "", target))
            labels.update({name: text for name, text in ((source, source_label), (target, target_label)) if text})
        elif (match := _BOX.fullmatch(line)) and match[2]:
            labels[match[1]] = group + match[2]
        elif _SOME_ARROW.search(line):
            raise ValueError(
                f'the site can\'t read this arrow of a diagram, one like `a -- "by" --> b`: {line.strip()}'
            )
    starts, ends = {**labels, "[*]": "(start)"}, {**labels, "[*]": "(end)"}
    rows = [f"| {starts.get(source, source)} | {by} | {ends.get(target, target)} |" for source, by, target in arrows]
    return "\n".join(["| from | by | to |", "|---|---|---|", *rows, ""])
