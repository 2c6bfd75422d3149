"""Imports run downward only, and each outside library has its one place."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from repository import PACKAGE

# From the bottom to the top, in a strict order: a part imports those before it only.
LAYERS = [
    ("errors", "exit_codes", "extras", "json_values", "names", "parameters", "paths", "plugins", "hot_loops", ""),
    *(
        (room,)
        for room in (
            "system",
            "network",
            "batch",
            "geometry",
            "schedule",
            "koopman",
            "surface",
            "bag",
            "vision",
            "world",
        )
    ),
    *((room,) for room in ("drive", "leader", "alignment", "follower", "analysis")),
    *((room,) for room in ("conversions", "components")),
    ("testing",),
    *(
        (room,)
        for room in ("viewing", "calibration", "experiment", "reporting", "nodes", "launching", "paper", "api", "cli")
    ),
]
LEVEL = {area: level for level, areas in enumerate(LAYERS) for area in areas}
ROS = re.compile(
    r"rclpy|rcl_interfaces|rosidl\w*|\w+_msgs|\w+_srvs|builtin_interfaces|ament_index_python|launch(_ros)?"
)

pytestmark = pytest.mark.xdist_group("layers")  # all ask for the same graph, which takes seconds

FILES = sorted(PACKAGE.rglob("*.py"))


def area_of(module: str) -> str:
    """The part of the package that a module lies in; empty for the package itself."""
    return module.split(".")[1] if "." in module else ""


def name_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def exists(module: str) -> bool:
    if not re.fullmatch(r"robot_formation(\.\w+)+", module):
        return False
    path = PACKAGE.parent.joinpath(*module.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def without_types(tree: ast.AST) -> ast.AST:
    """A module without what it imports for its annotations only."""

    class Remover(ast.NodeTransformer):
        def visit_If(self, node: ast.If) -> ast.AST | None:
            return None if ast.unparse(node.test) == "TYPE_CHECKING" else self.generic_visit(node)

    Remover().visit(tree)
    return tree


def imports(file: Path, *, for_types: bool = True) -> Iterator[str]:
    """Every module that a file imports, wherever in it, as an absolute name; modules named in a text too."""
    package = file.parent.relative_to(PACKAGE.parent).parts
    tree: ast.AST = ast.parse(file.read_text())
    for node in ast.walk(tree if for_types else without_types(tree)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and exists(node.value):
            yield node.value
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                yield inner if module.startswith("robot_formation") and exists(inner) else module


@cache
def graph() -> dict[str, set[str]]:
    """What each module of the package imports.

    What the package itself names for type checkers only, it imports when it is asked for it: names of "api", at the
    top.
    """
    return {name_of(file): set(imports(file, for_types=name_of(file) != PACKAGE.name)) for file in FILES}


@cache
def own() -> dict[str, set[str]]:
    """What of the package each of its modules imports."""
    return {module: {name for name in found if is_own(name)} for module, found in graph().items()}


def is_own(module: str) -> bool:
    return module.split(".")[0] == PACKAGE.name


def reachable(module: str) -> set[str]:
    """A module and all of the package's modules that importing it imports, directly or not."""
    seen: set[str] = set()
    todo = [module]
    while todo:
        current = todo.pop()
        if current not in seen:
            seen.add(current)
            todo += own().get(current, ())
    return seen


def test_every_part_of_the_package_has_its_layer() -> None:
    assert {area_of(module) for module in graph()} <= set(LEVEL)


def test_imports_run_downward_only() -> None:
    pairs = {(module, name) for module, names in own().items() for name in names}
    assert not {(module, name) for module, name in pairs if LEVEL[area_of(name)] > LEVEL[area_of(module)]}


def test_no_modules_import_each_other_in_a_circle_lazily_or_not() -> None:
    found = {name_of(file): set(imports(file, for_types=False)) for file in FILES}
    others = {module: {name for name in names if name in found and name != module} for module, names in found.items()}
    try:
        list(TopologicalSorter(others).static_order())
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(error.args[1])}")


def test_only_nodes_and_conversions_import_ros() -> None:
    importers = {module for module, names in graph().items() if any(ROS.fullmatch(n.split(".")[0]) for n in names)}
    assert {area_of(module) for module in importers} <= {"nodes", "conversions"}


def test_only_the_world_imports_pybullet() -> None:
    importers = {module for module, names in graph().items() if any(n.split(".")[0] == "pybullet" for n in names)}
    assert {area_of(module) for module in importers} <= {"world"}


def test_yaml_is_parsed_in_one_place() -> None:
    parses = re.compile(r"\byaml\.(\w*load\w*|parse|scan|compose\w*|\w*Loader)\b")
    files = [*FILES, *(PACKAGE.parent / "launch").glob("*.py")]
    assert {file.name for file in files if parses.search(file.read_text())} == {"yaml_files.py"}


@pytest.mark.parametrize("area", [room for (room,) in LAYERS[1 : LAYERS.index(("conversions",))]])
def test_these_parts_need_no_ros_not_even_indirectly(area: str) -> None:
    modules = [module for module in graph() if area_of(module) == area]
    assert modules
    for module in modules:
        assert not [name for name in reachable(module) if area_of(name) in {"nodes", "conversions"}]
