"""The modules that are compiled where an installation finds a C compiler: those with a .pxd file, their C types.

They are plain Python: elsewhere the same files are interpreted, with the same results to the last bit.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
from pathlib import Path

from robot_formation.paths import project_root

COMPILED = "compiled"
INTERPRETED = "interpreted"
OUT_OF_DATE = "compiled from an older source"
_PACKAGE = Path(__file__).resolve().parent


def hot_loops() -> dict[str, str]:
    """Tell of each module by its dotted name whether it is COMPILED, INTERPRETED or OUT_OF_DATE.

    Only a checkout has sources that change after they were compiled.
    """
    return {_module(types): _state(types) for types in sorted(_PACKAGE.rglob("*.pxd"))}


def _module(types: Path) -> str:
    return ".".join([_PACKAGE.name, *types.relative_to(_PACKAGE).with_suffix("").parts])


def _state(types: Path) -> str:
    spec = importlib.util.find_spec(_module(types))
    if spec is None or not isinstance(spec.loader, importlib.machinery.ExtensionFileLoader):
        return INTERPRETED
    built = Path(str(spec.origin)).stat().st_mtime_ns
    changed = max(path.stat().st_mtime_ns for path in (types, types.with_suffix(".py")) if path.exists())
    return OUT_OF_DATE if project_root() is not None and changed > built else COMPILED
