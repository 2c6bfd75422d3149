"""Pages of the Python API: one for each module that is public, and one for each public name of it."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Sequence
from types import ModuleType

from sphinx.ext.autodoc.mock import mock  # type: ignore[attr-defined]
from sphinx.util.logging import getLogger

_LOG = getLogger(__name__)

FOLDER = "reference/api"
MODULES = {
    "robot_formation": ("robot_formation", "scenarios, runs, sweeps and figures, in process and of bags"),
    "robot_formation.koopman": ("koopman", "dictionaries, EDMD, online DMD and their spectra"),
    "robot_formation.testing": ("testing", "checks for predictors, surfaces, paths and sensors of your own"),
    "robot_formation.koopman.predictors.models": ("Models of predictors", "what a predictor's model has"),
    "robot_formation.surface.base": ("Surfaces", "what a surface has"),
    "robot_formation.leader.paths.base": ("Leader's paths", "what a path has, and bases for paths"),
    "robot_formation.vision.sensors": ("Sensors", "what makes blocks of pictures"),
}
"""The public modules: what the site's navigation calls them, and what is in them."""

_INDEX = """\
Python API
==========
From the docstrings of the code. Lengths are in metres, angles in radians and times in seconds where nothing else is
said; *u* is to a robot's right, *v* ahead.

{described}

How to write classes of your own: :doc:`/how-to/extend`. What the Koopman library computes: :doc:`/explanation/koopman`.

.. toctree::
   :hidden:

{pages}
"""
_LONGEST_HEADING = 45
# What classes have from Python and its libraries is not repeated on their pages.
_FOREIGN = "object, Protocol, Generic, ABC, Enum, str, tuple, BaseException, BaseEstimator"


def public_names(module: ModuleType) -> list[str]:
    """List the public names of a module: of `__all__`, or its own without an underscore and with a docstring."""
    listed: Sequence[str] | None = getattr(module, "__all__", None)
    if listed is not None:
        return [name for name in listed if not name.startswith("__")]
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and getattr(value, "__module__", None) == module.__name__
        and inspect.getdoc(value)
        and (inspect.isclass(value) or inspect.isfunction(value))
    ]


def api_pages(mocked: Sequence[str]) -> dict[str, str]:
    """Make the pages: text by path in the site. `mocked` modules need not be installed."""
    pages: dict[str, str] = {}
    with mock(list(mocked)):
        for name in MODULES:
            try:
                pages.update(_pages_of(importlib.import_module(name)))
            except Exception as error:  # of a mocked package; rosdoc2 goes on without the pages
                _LOG.warning("no pages of module %s, which can't be imported: %s", name, error)
    listed = [name for name in MODULES if f"{FOLDER}/{name}.rst" in pages]
    index = _INDEX.format(
        described="\n".join(f"- :doc:`{name}`: {MODULES[name][1]}" for name in listed),
        pages="\n".join(f"   {MODULES[name][0]} <{name}>" for name in listed),
    )
    return {f"{FOLDER}/index.rst": index, **pages}


def _pages_of(module: ModuleType) -> dict[str, str]:
    names = public_names(module)
    own = {f"{FOLDER}/{_file(module.__name__, name, names)}.rst": _name_page(module, name) for name in names}
    return {f"{FOLDER}/{module.__name__}.rst": _module_page(module, names), **own}


def _file(module: str, name: str, names: Sequence[str]) -> str:
    """Name a page's file; Run and run differ on every file system."""
    alike = [each for each in names if each.lower() == name.lower()]
    return f"{module}.{name}" + ("-function" if len(alike) > 1 and name.islower() else "")


def _module_page(module: ModuleType, names: Sequence[str]) -> str:
    """A module's docstring, and tables of its names: a table for each file that defines some, under what it holds."""
    lines = [module.__name__, "=" * len(module.__name__), "", f".. automodule:: {module.__name__}", ""]
    groups: dict[str, list[str]] = {}
    for name in names:
        defined = getattr(getattr(module, name), "__module__", None) or module.__name__
        groups.setdefault(defined, []).append(name)
    for defined, members in groups.items():
        heading = _heading(defined)
        if len(groups) > 1:
            lines += [heading, "-" * len(heading), ""]
        lines += [".. autosummary::", "   :nosignatures:", "", *(f"   {name}" for name in members), ""]
    toctree = [f"   {_file(module.__name__, name, names)}" for name in names]
    return "\n".join([*lines, ".. toctree::", "   :hidden:", "", *toctree, ""])


def _heading(module: str) -> str:
    """What a module's docstring begins with, up to its first colon or full stop, if that is short; else its name."""
    text = (inspect.getdoc(importlib.import_module(module)) or "").partition("\n")[0]
    short = text.partition(":")[0].rstrip(".").replace("`", "")
    return short if 0 < len(short) <= _LONGEST_HEADING else module.rpartition(".")[2].replace("_", " ").capitalize()


def _name_page(module: ModuleType, name: str) -> str:
    value = getattr(module, name)
    lines = [name, "=" * len(name), "", f".. currentmodule:: {module.__name__}", ""]
    if inspect.isclass(value):
        kind = "exception" if issubclass(value, BaseException) else "class"
        members = ["   :members:", f"   :inherited-members: {_FOREIGN}", "   :special-members: __call__"]
        lines += [f".. auto{kind}:: {name}", *(members if kind == "class" else ["   :show-inheritance:"])]
    else:
        lines.append(f".. auto{'function' if callable(value) else 'data'}:: {name}")
    return "\n".join([*lines, ""])
