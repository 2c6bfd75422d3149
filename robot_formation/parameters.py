"""Parameters as frozen dataclasses: one source for type, default, unit, range and description.

A node's dataclass declares its ROS parameters, validates YAML and makes the table in the docs. Nested dataclasses
become dotted names (``robot.wheel_radius_m``), the form that ROS parameters use.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
import re
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

from robot_formation.errors import FormationError, shown

T = TypeVar("T")

LIST_ELEMENTS: dict[object, type] = {
    tuple[float, ...]: float,
    tuple[int, ...]: int,
    tuple[str, ...]: str,
}
"""Types of parameters that are lists, and of what."""

LENGTH_PAIRS = tuple[tuple[float, float], ...]
"""Type of parameters that are lists of pairs of lengths; only scenarios have such, ROS has none."""

ROWS = tuple[tuple[int | float | str, ...], ...]
"""Type of parameters that are lists of lists of numbers and words; only scenarios have such, ROS has none."""

_LONGEST_NAME = 100
_LISTED = 240  # characters
_EXPONENT = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+")


class Choice(str, Enum):
    """Base of parameters that take one of some words; a member equals its word, which YAML, ROS and JSON hold."""

    def __str__(self) -> str:
        return str(self.value)


class ParameterError(FormationError):
    """A parameter has an unknown name, a wrong type or a value outside its range; the text says which."""


# Parameters that have been given other names, in two tables, since what a file of then means for them differs.
FORMER_NAMES = {
    "formation.handicap": "formation.initial_loss",
    "precise.filter.calm_misfit": "precise.filter.calm_nis",
    "precise.filter.neighbour_sidestep_sigma_m": "precise.filter.step.aside_sigma_m",
    "precise.filter.neighbour_step_sigma_m": "precise.filter.step.length_sigma_m",
    "precise.filter.neighbour_turn_sigma_rad": "precise.filter.step.turn_sigma_rad",
    "precise.filter.slip_per_lean": "precise.filter.slip_per_tilt",
}
"""Names that parameters had before and today's: the value means the same, so that the former name is still taken."""

RENAMED = {"formation": "formation_namespace"}
"""Names that parameters had before and today's: the value means another thing now, so that the former name is refused.

The namespace was absolute and is relative to that of the robots by default; and the name is that of a group too.
"""


@dataclass(frozen=True)
class Spec:
    """One parameter: dotted name, Python type, default, unit, closed range or choices, description.

    `known` lists names that it can have where whoever uses them looks them up, and complains. `also` says of a name
    that is none of the choices whether it may be used too. Where the field's type is a `Choice`, `choice` is that
    class, and type, default and choices are those of its words.
    """

    name: str
    type: object
    default: Any
    unit: str
    low: float | None
    high: float | None
    choices: tuple[object, ...]
    description: str
    known: tuple[str, ...] = ()
    choice: Callable[[object], Choice] | None = None
    also: Callable[[str], bool] | None = None

    def plain_default(self) -> Any:
        """Return the default as YAML, ROS and JSON hold it: a list for a tuple."""
        return _plain_list(self.default) if isinstance(self.default, tuple) else self.default


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple[object, ...] = (),
    known: tuple[str, ...] = (),
    also: Callable[[str], bool] | None = None,
) -> Any:
    """Make a dataclass field that carries what `Spec` lists: unit, closed range [low, high] or choices, description."""
    said = {"description": description, "unit": unit, "low": low, "high": high}
    return dataclasses.field(default=default, metadata={**said, "choices": choices, "known": known, "also": also})


_BARE = dict(parameter(None, "").metadata)
"""Of fields that were not made by `parameter`, as in classes from outside the package."""


@functools.lru_cache(maxsize=256)
def _type_hints(cls: type) -> dict[str, Any]:
    """Types of a dataclass's fields. They are written as texts, and evaluating them takes most of a build's time."""
    return typing.get_type_hints(cls)


def specs(cls: type, prefix: str = "", *, defaults: object = None) -> dict[str, Spec]:
    """List the parameters of a dataclass by dotted name, nested dataclasses included.

    Args:
        cls: the dataclass.
        prefix: put before every name.
        defaults: an instance of it, if its values and not the class's are the defaults.
    """
    found: dict[str, Spec] = {}
    hints = _type_hints(cls)
    for field in dataclasses.fields(cls):
        kind = hints[field.name]
        name = prefix + field.name
        if dataclasses.is_dataclass(kind):
            inner = field.default if defaults is None else getattr(defaults, field.name)
            inner = None if inner is dataclasses.MISSING else inner
            found.update(specs(typing.cast(type, kind), name + ".", defaults=inner))
            continue
        meta = {**_BARE, **field.metadata}
        default = field.default if defaults is None else getattr(defaults, field.name)
        choice = kind if isinstance(kind, type) and issubclass(kind, Choice) else None
        found[name] = Spec(
            name,
            str if choice else kind,
            _plain(default),
            meta["unit"],
            meta["low"],
            meta["high"],
            tuple(member.value for member in choice) if choice else tuple(meta["choices"]),
            meta["description"],
            tuple(meta["known"]),
            choice,
            meta["also"],
        )
    return found


@functools.lru_cache(maxsize=256)
def _known(cls: type) -> Mapping[str, Spec]:
    """List the parameters of a dataclass: `specs`, only to be read, for what asks again and again."""
    return types.MappingProxyType(specs(cls))


def _plain(value: object) -> object:
    return value.value if isinstance(value, Choice) else value


def _plain_list(values: tuple[object, ...]) -> list[object]:
    return [list(value) if isinstance(value, tuple) else value for value in values]


def todays_names(values: Mapping[str, T], *, where: str = "parameters") -> dict[str, T]:
    """Return parameters under their present names: values by dotted names, of which some may be former ones.

    Raises:
        ParameterError: if a parameter is given by both names.
    """
    found: dict[str, T] = {}
    for name, value in values.items():
        now = FORMER_NAMES.get(name, name)
        if now in found:
            raise ParameterError(f"{where}: '{now}' is given twice, also by a former name; keep one of them")
        found[now] = value
    return found


def no_parameter(name: str, known: Collection[str]) -> str:
    """Return a text that there is no parameter of this name, and which one was probably meant."""
    now = RENAMED.get(name, "")
    hint = f"; it is called '{now}' now" if now in known else suggestion(name, known)
    return f"no parameter '{name}'{hint}"


def flatten(values: Mapping[str, object], prefix: str = "", *, where: str = "parameters") -> dict[str, object]:
    """Turn nested mappings into one with dotted names, today's; `where` they stand is for messages.

    Raises:
        ParameterError: if a name is given twice, nested and with dots.
    """
    flat: dict[str, object] = {}
    for key, value in values.items():
        inner = (
            flatten(value, f"{prefix}{key}.", where=where) if isinstance(value, Mapping) else {f"{prefix}{key}": value}
        )
        inner = {FORMER_NAMES.get(name, name): inner_value for name, inner_value in inner.items()}
        for name in inner:
            if name in flat:
                raise ParameterError(
                    f"{where}: '{name}' is given twice, nested and with dots or by a former name; keep one of them"
                )
        flat.update(inner)
    return flat


def to_mapping(instance: Any, prefix: str = "") -> dict[str, Any]:
    """Turn a parameter object into a mapping of dotted names to plain values: lists for tuples, words for choices."""
    values: dict[str, Any] = {}
    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        if dataclasses.is_dataclass(value):
            values.update(to_mapping(value, f"{prefix}{field.name}."))
        else:
            values[prefix + field.name] = _plain_list(value) if isinstance(value, tuple) else _plain(value)
    return values


def from_mapping(cls: type[T], values: Mapping[str, object], *, where: str) -> T:
    """Build and check a parameter object from nested or dotted names.

    Args:
        cls: a frozen dataclass whose fields are made by `parameter` or are such dataclasses themselves.
        values: any subset of the parameters; the others keep their defaults.
        where: what the values belong to, for messages ("config/world.yaml", "drive").

    Raises:
        ParameterError: on an unknown name, a wrong type, or a value outside its range or choices.
    """
    known = _known(typing.cast(type, cls))
    flat = flatten(values, where=where)
    for name in flat:
        if name not in known:
            raise ParameterError(f"{where}: no parameter '{name}'{suggestion(name, known)}")
    return _build(cls, {name: check(known[name], value, where=where) for name, value in flat.items()})


def read_texts(cls: type, texts: Iterable[str], *, where: str, example: str) -> dict[str, Any]:
    """Read texts like 'size_m=2.0', in which a ROS parameter can hold parameters of a dataclass.

    Args:
        cls: a frozen dataclass as for `from_mapping`, which checks names, types and ranges.
        texts: a name and a value each.
        where: what the parameters belong to, for messages ("surface 'bowl'").
        example: of such a text, for messages.

    Raises:
        ParameterError: on a text that is no name and value, a name that comes twice, or a value that is no number where
            one is needed.
    """
    known = specs(cls)
    values: dict[str, Any] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise ParameterError(f"{where}: its parameters are texts like '{example}', not {shown(text)}")
        if key in values:
            raise ParameterError(f"{where}: '{key}' is given twice; keep one of them")
        kind = known[key].type if key in known else str  # an unknown name is refused as such
        values[key] = value if kind is str else _number_of(value, kind, f"{where}: '{key}'")
    return values


def _number_of(text: str, kind: object, subject: str) -> object:
    try:
        return int(text) if kind is int else float(text)
    except ValueError:
        what = "a whole number" if kind is int else "a number"
        raise ParameterError(f"{subject} needs {what}, not {shown(text)}") from None


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return a text with the known name that was probably meant, whatever its case, or list what there is."""
    candidates = list(known)
    name = name[:_LONGEST_NAME]  # finding what is near takes the square of the length
    folded = {candidate.casefold(): candidate for candidate in reversed(candidates)}
    near = [folded[match] for match in difflib.get_close_matches(name.casefold(), folded, n=1)]
    if not near and name:
        near = [c for c in candidates if c.rsplit(".", 1)[-1] == name.rsplit(".", 1)[-1]][:1]
    if near:
        return f"; did you mean '{near[0]}'?"
    return "; there are: " + _listed(sorted(candidates)) if candidates else ""


def _listed(candidates: list[str]) -> str:
    """List names, as many as fit into a message."""
    listed = list(candidates)
    while len(", ".join(listed)) > _LISTED:
        listed.pop()
    rest = len(candidates) - len(listed)
    return ", ".join(listed) + (f" and {rest} more" if rest else "")


def check(spec: Spec, value: object, *, where: str) -> object:
    """Return the value in the parameter's type, or raise ParameterError."""
    return check_as(spec, value, f"{where}: '{spec.name}'")


def check_as(spec: Spec, value: object, subject: str) -> object:
    """Return the value in the parameter's type; errors begin with the subject, like an option of the command line.

    Raises:
        ParameterError: on a wrong type, or a value outside the range or the choices.
    """
    if spec.type == LENGTH_PAIRS:
        return _check_pairs(spec, value, subject)
    if spec.type == ROWS:
        return _check_rows(value, subject)
    if spec.type in LIST_ELEMENTS:
        if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
            raise ParameterError(f"{subject} must be a list, not {shown(value)}")
        items = tuple(_check_one(spec, LIST_ELEMENTS[spec.type], item, subject) for item in value)
        if spec.default and not items:
            raise ParameterError(f"{subject} must not be empty")
        return items
    kind = spec.type
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        raise TypeError(f"{spec.name}: optional parameters are not supported; use a neutral default")
    checked = _check_one(spec, typing.cast(type, kind), _plain(value), subject)
    return spec.choice(checked) if spec.choice else checked


def _check_pairs(spec: Spec, value: object, subject: str) -> object:
    wrong = ParameterError(f"{subject} must be a list of pairs like [[0.32, -0.05]], not {shown(value)}")
    if not isinstance(value, (list, tuple)):
        raise wrong
    for pair in value:
        if not isinstance(pair, (list, tuple)) or len(pair) != 2:
            raise wrong
    return tuple(tuple(_check_one(spec, float, item, subject) for item in pair) for pair in value)


def _check_rows(value: object, subject: str) -> object:
    wrong = ParameterError(f"{subject} must be a list of lists, [[...], ...], not {shown(value)}")
    if not isinstance(value, (list, tuple)):
        raise wrong
    found = []
    for row in value:
        if not isinstance(row, (list, tuple)):
            raise wrong
        for item in row:
            if isinstance(item, bool) or not isinstance(item, (int, float, str)):
                raise ParameterError(f"{subject}: {shown(item)} is neither a number nor a name")
        found.append(tuple(row))
    return tuple(found)


def _check_one(spec: Spec, kind: type, value: object, subject: str) -> object:
    wrong = ParameterError(f"{subject} must be of type {kind.__name__}, not {shown(value)}")
    if kind is float and isinstance(value, str) and _EXPONENT.fullmatch(value):
        value = float(value)  # YAML 1.1 takes 1e3, without a dot, for text
    if kind is float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise wrong
        try:
            value = float(value)
        except OverflowError:  # a whole number of more than 308 digits
            value = math.inf
        if not math.isfinite(value):
            raise ParameterError(f"{subject} must be finite, not {shown(value)}")
    elif kind is int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise wrong
    elif not isinstance(value, kind):
        raise wrong
    if spec.choices and value not in spec.choices and not (spec.also and spec.also(str(value))):
        hint = suggestion(str(value), [str(c) for c in spec.choices])
        raise ParameterError(f"{subject} can't be {shown(value)}{hint}")
    low, high = spec.low, spec.high
    number = value if isinstance(value, (int, float)) else 0.0
    if (low is not None and number < low) or (high is not None and number > high):
        limits = f"{'-inf' if low is None else low} to {'inf' if high is None else high} {spec.unit}".rstrip()
        raise ParameterError(f"{subject} is {shown(value)}, outside {limits}")
    return value


def _build(cls: type[T], flat: Mapping[str, object], prefix: str = "", defaults: object = None) -> T:
    hints = _type_hints(typing.cast(type, cls))
    arguments: dict[str, Any] = {}
    for field in dataclasses.fields(cls):  # type: ignore[arg-type]
        kind = hints[field.name]
        name = prefix + field.name
        if dataclasses.is_dataclass(kind):
            inner = field.default if defaults is None else getattr(defaults, field.name)
            inner = None if inner is dataclasses.MISSING else inner
            arguments[field.name] = _build(typing.cast(type, kind), flat, name + ".", inner)
        elif name in flat:
            arguments[field.name] = flat[name]
        elif defaults is not None:
            arguments[field.name] = getattr(defaults, field.name)
    return cls(**arguments)
