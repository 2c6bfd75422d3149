"""YAML, read and written: the only place that parses it. Whatever is wrong with it is told in one line.

Beyond what PyYAML refuses, keys that are given twice are refused, and so are texts whose values would be larger or
nested deeper than any file of this project.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from robot_formation.errors import FormationError, shown
from robot_formation.system.files import read_file

MOST_BYTES = 1 << 20
_MOST_DEPTH = 32
_MOST_VALUES = 100_000  # with every alias written out
_MOST_BITS = 1024  # of a whole number: more than a float can hold
_MERGE = "tag:yaml.org,2002:merge"

Yaml: TypeAlias = Any
"""A value of a YAML file."""

# libyaml's parser and emitter where PyYAML was built with it: ten times as fast, and they write the same.
_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class YamlError(FormationError):
    """A text is no YAML that can be used; the text says why.

    Attributes:
        line: where, from 1; None if unknown.
        problem: what is wrong.
    """

    def __init__(self, problem: str, line: int | None = None) -> None:
        super().__init__(f"no valid YAML{'' if line is None else f' in line {line}'}: {problem}")
        self.problem = problem
        self.line = line


def parse_yaml(text: str | bytes) -> Yaml:
    """Read a YAML text safely: plain values, lists and mappings; None of an empty text.

    Raises:
        YamlError: naming the line and what is wrong there.
    """
    try:
        decoded = text.decode("utf-8-sig") if isinstance(text, bytes) else text
    except UnicodeDecodeError:
        raise YamlError("it is no text in UTF-8") from None
    if len(decoded) > MOST_BYTES:
        raise YamlError(f"it has more than {MOST_BYTES} characters")
    loader = None
    try:
        _check_events(yaml.parse(decoded, Loader=_Base))
        loader = _Loader(decoded)
        node = loader.get_single_node()
        if node is None:
            return None
        _check_keys(node)
        return loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise YamlError(_plain(error.problem or error.context), mark.line + 1 if mark else None) from None
    except YamlError:
        raise
    except Exception as error:  # PyYAML's readers and constructors let many kinds through
        raise YamlError(_plain(str(error))) from None
    finally:
        if loader is not None:
            loader.dispose()


def yaml_text(value: object, *, sort_keys: bool = False) -> str:
    """Write plain values as YAML in block style, keys in their order unless they are to be sorted."""
    return yaml.dump(value, Dumper=_Dumper, sort_keys=sort_keys, default_flow_style=False)  # type: ignore[no-any-return]


def read_yaml(path: str | Path, *, refuse: type[FormationError], remedy: str) -> Yaml:
    """Read a YAML (or JSON) file safely.

    Args:
        path: of the file.
        refuse: the error to raise.
        remedy: what to do if the file can't be opened, for the message.

    Raises:
        FormationError: of the kind `refuse`, with the file, the line where it is known, and what is wrong.
    """
    try:
        content = read_file(path, MOST_BYTES)
    except OSError as error:
        raise refuse(f"{path}: can't be read ({error.strerror or error}); {remedy}") from None
    try:
        return parse_yaml(content)
    except YamlError as error:
        raise refuse(f"{path}: {error}; correct the file") from None


class _Loader(_Base):  # type: ignore[misc]
    """Gives every failure of a value the line that it stands in."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Yaml:
        try:
            value = super().construct_object(node, deep=deep)
        except yaml.YAMLError:
            raise
        except Exception as error:  # int('0x'), bool('x'), a date in month 99
            kind = node.tag.rpartition(":")[2]
            text = shown(node.value if isinstance(node.value, str) else kind, 40)
            raise yaml.constructor.ConstructorError(
                None, None, f"{text} can't be read as {kind}", node.start_mark
            ) from error
        if isinstance(value, int) and value.bit_length() > _MOST_BITS:
            raise yaml.constructor.ConstructorError(
                None, None, f"{shown(value)} is larger than any number that is used here", node.start_mark
            )
        return value


def _check_events(events: Iterator[yaml.Event]) -> None:
    """Refuse what would be too deep or too large: the parser itself needs no more memory than the text."""
    sizes: dict[str, int] = {}
    open_nodes: list[tuple[str | None, int]] = [(None, 0)]
    for event in events:
        line = event.start_mark.line + 1 if event.start_mark else None
        size = 0
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes:
                raise YamlError(f"'*{event.anchor}' stands inside what it refers to, or before it", line)
            size = sizes[event.anchor]
        elif isinstance(event, yaml.CollectionStartEvent):
            open_nodes.append((event.anchor, 1))
            if len(open_nodes) > _MOST_DEPTH:
                raise YamlError(f"it is nested more than {_MOST_DEPTH - 1} deep", line)
        elif isinstance(event, (yaml.CollectionEndEvent, yaml.ScalarEvent)):
            anchor, size = (event.anchor, 1) if isinstance(event, yaml.ScalarEvent) else open_nodes.pop()
            if anchor is not None:
                sizes[anchor] = size
        if size:
            outer, sum_before = open_nodes[-1]
            open_nodes[-1] = (outer, sum_before + size)
            if sum_before + size > _MOST_VALUES:
                raise YamlError(f"it holds more than {_MOST_VALUES} values, each alias counted anew", line)


def _check_keys(root: yaml.Node | None) -> None:
    """Refuse mappings that give a key twice, of which YAML would silently keep the last."""
    waiting, seen = [root], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            waiting.extend(node.value)
        elif isinstance(node, yaml.MappingNode):
            lines: dict[tuple[str, str], int] = {}
            for key, value in node.value:
                waiting += [key, value]
                if not isinstance(key, yaml.ScalarNode) or key.tag == _MERGE:
                    continue
                line, name = key.start_mark.line + 1, (key.tag, key.value)
                if name in lines:
                    raise YamlError(
                        f"{shown(key.value)} is given twice (first in line {lines[name]}); keep one of them", line
                    )
                lines[name] = line


def _plain(text: str | None) -> str:
    return " ".join((text or "it can't be read").split())[:160]
