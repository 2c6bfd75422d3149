"""Rewrites the parameter tables of the node pages, and the schema of scenario files, from the parameters' dataclasses.

The table of a page, and below it what can be set while the node runs, stand between the comments <!-- parameters -->
and <!-- /parameters -->.

Run: python docs/make_parameter_tables.py [--check]
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from marked_text import with_marked
from robot_formation.components.catalogue import KINDS
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.experiment.scenario_json_schema import scenario_schema
from robot_formation.nodes.host.ros_parameters import AT_START, HostParameters, reasons
from robot_formation.nodes.player.player_node import PlayerNode, PlayerParameters
from robot_formation.nodes.progress.progress_node import ProgressExecutable, ProgressParameters
from robot_formation.nodes.recorder.recorder_node import RecorderNode, RecorderParameters
from robot_formation.nodes.viewer.viewer_node import ViewerExecutable, ViewerParameters
from robot_formation.parameters import Spec, specs

SCHEMA = Path(__file__).parents[1] / "config" / "scenario.schema.json"
PAGES = Path(__file__).parent / "reference" / "nodes"
COMMON = "common"
HEAD = "| name | type | unit | default | range | description |\n|---|---|---|---|---|---|"
_TYPES: dict[Any, str] = {
    bool: "bool",
    int: "int",
    float: "double",
    str: "string",
    tuple[float, ...]: "double[]",
    tuple[int, ...]: "int[]",
    tuple[str, ...]: "string[]",
}


def parameter_classes() -> dict[str, type]:
    """List the parameter class of every page, by the page's name."""
    classes = {name: kind.parameter_class() for name, kind in KINDS.items()}
    others: dict[str, type] = {
        "recorder": RecorderParameters,
        "player": PlayerParameters,
        "progress": ProgressParameters,
        "viewer": ViewerParameters,
    }
    return {**classes, **others, COMMON: HostParameters}


def fixed_parameters(name: str) -> Mapping[str, str]:
    """List why parameters of a page can't be set while the node runs, by shell pattern."""
    if name in KINDS:
        return KINDS[name].component_class().fixed
    others = {
        "recorder": RecorderNode.fixed,
        "player": PlayerNode.fixed,
        "progress": ProgressExecutable.fixed,
        "viewer": ViewerExecutable.fixed,
    }
    return {**others, COMMON: {"*": AT_START}}[name]


def changes(name: str, parameters: type) -> str:
    """Say which parameters can be set while the node runs."""
    known = list(specs(parameters))
    fixed = reasons(known, fixed_parameters(name))
    free = [f"`{parameter}`" for parameter in known if parameter not in fixed]
    why = "; ".join(dict.fromkeys(fixed.values()))
    if not fixed:
        return "All can be set while the node runs (`ros2 param set`)."
    if not free:
        return f"None can be set while the node runs; the reason that is given: {why}."
    if len(free) < len(fixed):
        return f"While the node runs, {' and '.join(free)} can be set. The reason that is given for the others: {why}."
    named = " and ".join(f"`{parameter}`" for parameter in fixed)
    return f"All but {named} can be set while the node runs (`ros2 param set`); the reason that is given: {why}."


def table(name: str, parameters: type) -> str:
    """Make a page's table; where config/NODE.yaml differs from the default, its value is given too."""
    configured = node_defaults(name) if name in KINDS else {}
    return "\n".join([HEAD, *(_row(spec, configured) for spec in specs(parameters).values())])


def updated(name: str, parameters: type) -> tuple[str, str]:
    """Return a page's text as it is, and as it should be.

    Raises:
        FormationError: if the page has no place for the table.
    """
    written = f"{table(name, parameters)}\n\n{changes(name, parameters)}"
    return with_marked(PAGES / f"{name}.md", "parameters", written)


def _row(spec: Spec, configured: dict[str, object]) -> str:
    default = spec.plain_default()
    said = _value(default)
    if spec.name in configured and configured[spec.name] != default:
        said += f"; {_value(configured[spec.name])} in config"
    description = spec.description.replace("|", "\\|")
    cells = (f"`{spec.name}`", _TYPES[spec.type], spec.unit, said, _range(spec), description)
    return "| " + " | ".join(cells) + " |"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_value(item) for item in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"`{value}`".replace("|", "\\|") if value != "" else '`""`'


def _range(spec: Spec) -> str:
    if spec.choices:
        return ", ".join(f"`{choice}`" for choice in spec.choices)
    if spec.low is None and spec.high is None:
        return ""
    low, high = ("" if limit is None else f"{limit:.12g}" for limit in (spec.low, spec.high))
    return f"{low} .. {high}"


def main() -> int:
    """Rewrite the tables, or with --check only tell what is out of date (exit code 1)."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a table is out of date")
    check = parser.parse_args().check
    stale = []
    for name, parameters in parameter_classes().items():
        before, after = updated(name, parameters)
        if before != after:
            stale.append(name)
            if not check:
                (PAGES / f"{name}.md").write_text(after, encoding="utf-8")
    schema = json.dumps(scenario_schema(), indent=1) + "\n"
    if not SCHEMA.exists() or SCHEMA.read_text(encoding="utf-8") != schema:
        stale.append(SCHEMA.name)
        if not check:
            SCHEMA.write_text(schema, encoding="utf-8")
    print(f"{'out of date' if check else 'rewritten'}: {', '.join(stale) or 'none'}")
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
