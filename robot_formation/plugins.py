"""Classes from outside the package, found by name: entry points of installed packages, and `module:Class`.

A package names its classes in the entry-point groups of `GROUPS`; a class of the user's own needs no packaging, if its
module can be imported or lies in the working directory. Nothing is imported before a name is asked for.
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.metadata
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar

from robot_formation.json_values import Json
from robot_formation.parameters import ParameterError, from_mapping, suggestion

T = TypeVar("T")

GROUPS: Mapping[str, str] = MappingProxyType(
    {kind: f"robot_formation.{kind}s" for kind in ("predictor", "surface", "path", "sensor")}
)
"""Entry-point group of each kind of class that can be added."""

NOTEBOOK = "__main__:"
"""How names of classes of the running script or notebook begin."""

FAILURES = (Exception, SystemExit)
"""What a class from outside may raise, whatever it does; an interrupt is the user's."""

LOADED: set[str] = set()
"""Names of the classes from outside that this process has loaded."""

_CLASS = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")
_SUBJECT = re.compile(r"\w+ '[^']*'")


class PluginError(ParameterError):
    """A class from outside can't be found or used; the text says which, where it is from, and why."""


@dataclass(frozen=True)
class Plugin:
    """An entry point: the class's name here, where it is ('module:Class'), and the package that it came with."""

    name: str
    value: str
    package: str


@cache
def installed(kind: str) -> Mapping[str, Plugin]:
    """List a kind's entry points by name; of several with one name the first. Nothing is imported.

    Args:
        kind: a key of `GROUPS`.
    """
    found: dict[str, Plugin] = {}
    for entry in importlib.metadata.entry_points(group=GROUPS[kind]):
        package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "an unknown package"
        found.setdefault(entry.name, Plugin(entry.name, entry.value, package))
    return MappingProxyType(found)


def may_be(name: str, kind: str) -> bool:
    """Whether a name is of the form 'module:Class', or an entry point's. Imports nothing."""
    return _CLASS.fullmatch(name) is not None or name in installed(kind)


def unknown(kind: str, name: str, own: Iterable[str] = ()) -> PluginError:
    """Make the error of a name that is neither one of the package's own nor one from outside."""
    return PluginError(f"no {kind} '{name}'{suggestion(name, [*own, *installed(kind)])}")


def check_name(kind: str, name: str, own: Iterable[str]) -> None:
    """Check that a name may be used: one of the package's own, an entry point's, or 'module:Class'. Imports nothing.

    Raises:
        PluginError: with the nearest known name.
    """
    if name not in own and not may_be(name, kind):
        raise unknown(kind, name, own)


def load(kind: str, name: str) -> type:
    """Import the class of this name from outside the package.

    It is looked up in its module each time: a notebook may have defined it anew, or reloaded the module.

    Args:
        kind: a key of `GROUPS`.
        name: an entry point's, or 'module:Class'.

    Raises:
        PluginError: if there is none, or its module or class can't be imported.
    """
    if not may_be(name, kind):
        raise unknown(kind, name)
    plugin = installed(kind).get(name)
    value, origin = (plugin.value, f" (package {plugin.package})") if plugin else (name, "")
    subject = f"{kind} '{name}'{origin}"
    module, _, attribute = value.partition(":")
    try:
        with nullcontext() if module in sys.modules else _working_directory():
            found = getattr(importlib.import_module(module), attribute.strip(), None)
    except ModuleNotFoundError as error:
        raise PluginError(f"{subject}: {_missing(str(error.name), module, packaged=plugin is not None)}") from error
    except FAILURES as error:  # whatever the module does when it is imported
        raise PluginError(f"{subject}: can't be imported: {_told(error)}") from error
    if found is None:
        raise PluginError(f"{subject}: module '{module}' has no '{attribute}'")
    if not isinstance(found, type):
        raise PluginError(f"{subject}: '{value}' is no class")
    LOADED.add(name)
    return found


def _missing(name: str, module: str, *, packaged: bool) -> str:
    """Explain a missing module: the class's own, or one that its module imports."""
    if not f"{module}.".startswith(f"{name}."):
        return f"can't be imported: it needs the module '{name}', which is not installed"
    hint = "" if packaged else "; modules are looked for among the installed ones and in the working directory"
    return f"no module '{name}'{hint}"


def completed(kind: str, name: str, found: type, *, needs: str, base: type, members: Mapping[str, object]) -> type[Any]:
    """Return a class from outside with the members of a base that it leaves out, as a dataclass.

    It is frozen and its fields are its parameters; a class with a constructor of its own has none.

    Args:
        kind: a key of `GROUPS`.
        name: of the class here.
        found: the class.
        needs: the method that the class must have.
        base: has defaults for everything else.
        members: that go before the class's own.

    Raises:
        PluginError: if it can't be made without arguments, or lacks the method.
    """
    if not callable(getattr(found, needs, None)):
        raise PluginError(f"{kind} '{name}': it has no method '{needs}'; see docs/how-to/extend.md")
    if dataclasses.is_dataclass(found) and not found.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        raise PluginError(
            f"{kind} '{name}': write @dataclass(frozen=True), so that its parameters can't change in a run"
        )
    parts = (found,) if issubclass(found, base) else (found, base)
    own = {"name": name, "__doc__": found.__doc__ or f"A {kind} from outside the package.", **members}
    try:
        makes_itself = has_constructor(found)
        options = {"init": not makes_itself, "frozen": not makes_itself, "eq": not makes_itself}
        made: type[Any] = dataclasses.dataclass(**options)(type(found.__name__, parts, own))
        made()
    except FAILURES as error:
        raise failed(kind, name, "making one without arguments", error) from error
    return made


def build(kind: str, name: str, found: type[T], values: Mapping[str, Json]) -> T:
    """Make one of a class from outside, with values for its parameters.

    Raises:
        ParameterError: on an unknown parameter or a value that can't be used, also if the class itself refuses it.
    """
    try:
        return from_mapping(found, values, where=f"{kind} '{name}'")
    except ParameterError:
        raise
    except FAILURES as error:
        raise failed(kind, name, "making one", error) from error


def has_constructor(found: type) -> bool:
    """Whether a class from outside has a constructor of its own, other than a dataclass's."""
    return not dataclasses.is_dataclass(found) and found.__init__ is not object.__init__  # type: ignore[misc]


def subject(error: PluginError) -> str:
    """Return whose error it is: the kind and name of the class, with which its text begins."""
    text = str(error)
    match = _SUBJECT.match(text)
    return match[0] if match else text


def processes(jobs: int, names: Iterable[str]) -> int:
    """Return how many processes may run classes of these names: other processes have another `__main__`."""
    return 1 if any(name.startswith(NOTEBOOK) for name in names) else jobs


@contextmanager
def guarded(kind: str, name: str, what: str) -> Iterator[None]:
    """Turn whatever a class from outside raises into a PluginError that says what failed."""
    try:
        yield
    except PluginError:
        raise
    except FAILURES as error:
        raise failed(kind, name, what, error) from error


def failed(kind: str, name: str, what: str, error: BaseException) -> PluginError:
    """Make the error of a class from outside that failed at something, in one line."""
    return PluginError(f"{kind} '{name}': {what} failed: {_told(error)}")


def _told(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__


@contextmanager
def _working_directory() -> Iterator[None]:
    """Let modules in the working directory be found, after all others; console scripts don't look there."""
    folder = os.getcwd()
    if folder in sys.path or "" in sys.path:
        yield
        return
    sys.path.append(folder)
    try:
        yield
    finally:
        sys.path.remove(folder)
