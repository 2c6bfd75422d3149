"""Imports run downward only, and each outside library has its one place."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "robot_formation"

LAYERS = [
    {
        *("", "errors", "exit_codes", "files", "loopback", "names", "parameters", "paths", "png_files", "tags"),
        *("shared_memory_space", "yaml_files"),
    },
    {"geometry"},
    {"surface"},
    {"world"},
    {"control", "koopman", "vision"},
    {"components", "conversions"},
    {"analysis", "bag", "experiment"},
    {"nodes"},
    {"launching"},
    {"cli"},
]
LEVEL = {area: level for level, areas in enumerate(LAYERS) for area in areas}
ROS = re.compile(
    r"rclpy|rcl_interfaces|rosidl\w*|\w+_msgs|\w+_srvs|builtin_interfaces|ament_index_python|launch(_ros)?"
)

FILES = sorted(PACKAGE.rglob("*.py"))


def area_of(module: str) -> str:
    """The part of the package that a module lies in; empty for the package itself."""
    return module.split(".")[1] if "." in module else ""


def name_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def exists(module: str) -> bool:
    path = PACKAGE.parent.joinpath(*module.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def imports(file: Path) -> Iterator[str]:
    """Every module that a file imports, wherever in it, as an absolute name."""
    package = file.parent.relative_to(PACKAGE.parent).parts
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                yield inner if module.startswith("robot_formation") and exists(inner) else module


GRAPH = {name_of(file): set(imports(file)) for file in FILES}
OWN = {module: {name for name in found if name.split(".")[0] == "robot_formation"} for module, found in GRAPH.items()}


def reachable(module: str) -> set[str]:
    """A module and all of the package's modules that importing it imports, directly or not."""
    seen: set[str] = set()
    todo = [module]
    while todo:
        current = todo.pop()
        if current not in seen:
            seen.add(current)
            todo += OWN.get(current, ())
    return seen


def test_every_part_of_the_package_has_its_layer():
    assert {area_of(module) for module in GRAPH} <= set(LEVEL)


def test_imports_run_downward_only():
    pairs = {(module, name) for module, names in OWN.items() for name in names}
    assert not {(module, name) for module, name in pairs if LEVEL[area_of(name)] > LEVEL[area_of(module)]}


def test_neighbours_in_a_layer_do_not_import_each_other_both_ways():
    pairs = {(area_of(module), area_of(name)) for module, names in OWN.items() for name in names}
    both_ways = {(a, b) for a, b in pairs if a < b and (b, a) in pairs}
    assert not both_ways


def test_only_nodes_and_conversions_import_ros():
    importers = {module for module, names in GRAPH.items() if any(ROS.fullmatch(n.split(".")[0]) for n in names)}
    assert {area_of(module) for module in importers} <= {"nodes", "conversions"}


def test_only_the_world_imports_pybullet():
    importers = {module for module, names in GRAPH.items() if any(n.split(".")[0] == "pybullet" for n in names)}
    assert {area_of(module) for module in importers} <= {"world"}


@pytest.mark.parametrize("area", ["analysis", "bag", "control", "koopman", "surface", "vision", "world"])
def test_these_parts_need_no_ros_not_even_indirectly(area):
    modules = [module for module in GRAPH if area_of(module) == area]
    assert modules
    for module in modules:
        assert not [name for name in reachable(module) if area_of(name) in {"nodes", "conversions"}]
