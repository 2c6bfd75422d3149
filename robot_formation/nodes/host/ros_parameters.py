"""Declares a parameter dataclass on an rclpy node: descriptors, ranges, and errors for what is not in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from robot_formation.errors import FormationError
from robot_formation.parameters import (
    ParameterError,
    Spec,
    from_mapping,
    no_parameter,
    parameter,
    specs,
    suggestion,
    to_mapping,
    todays_names,
)

T = TypeVar("T")

# What rclpy itself declares or reads on every node.
_QOS = "qos_overrides."
_OF_RCLPY = ("use_sim_time", "start_type_description_service", _QOS)
_TYPES: dict[Any, Parameter.Type] = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
    tuple[float, ...]: Parameter.Type.DOUBLE_ARRAY,
    tuple[int, ...]: Parameter.Type.INTEGER_ARRAY,
    tuple[str, ...]: Parameter.Type.STRING_ARRAY,
}
_LARGE = 1e308
AT_START = "it is used while the node starts"
"""Why the parameters that all nodes have can't be set later."""


@dataclass(frozen=True)
class HostParameters:
    """What every node has beside its own parameters."""

    formation_namespace: str = parameter(
        "formation", "Namespace of the done ticks; if relative, in the namespace that the robots' lie in"
    )
    wait_for_listeners_s: float = parameter(
        5.0, "How long a first message is held back for its listeners to appear", unit="s", low=0.0, high=3600.0
    )
    recorder: str = parameter("", "Name of a recorder that must listen too before anything is sent; empty: none")
    record_images: bool = parameter(False, "Whether that recorder records images")
    wait_for_nodes: tuple[str, ...] = parameter(
        (),
        "Nodes that must be in the graph before this one begins, like follower_1/block_detector; if relative, in the "
        "namespace that the robots' lie in",
    )


class ParameterNode(Node):
    """rclpy's node, more helpful when parameters are set while it runs.

    A refusal is a sentence that says why. Values take the parameter's type where that is meant (1 for 1.0, an empty
    list). A read-only parameter that is set to the value that it has is no error, so that `ros2 param load` takes what
    `ros2 param dump` gave.

    Attributes:
        fixed: why each read-only parameter can't be set.
    """

    def __init__(self, name: str) -> None:
        self.fixed: dict[str, str] = {}
        super().__init__(name, allow_undeclared_parameters=False)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """See rclpy's Node; both of its services for setting parameters come here."""
        changes = []
        try:
            values = todays_names({item.name: item for item in parameter_list}, where=self.get_name())
        except ParameterError as error:
            return _refused(str(error))
        for name, given in values.items():
            if not self.has_parameter(name):
                return _refused(no_parameter(name, self._parameters))
            current = self.get_parameter(name)
            item = _like(current, Parameter(name, given.type_, given.value))
            if not self.describe_parameter(item.name).read_only:
                changes.append(item)
            elif _bare(item.value) != _bare(current.value):
                reason = self.fixed.get(item.name, AT_START)
                return _refused(f"'{item.name}' can't be set while {self.get_name()} runs: {reason}")
        return super().set_parameters_atomically(changes) if changes else SetParametersResult(successful=True)


def _refused(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)


def _bare(value: Any) -> Any:
    """Make a list of the array that a message holds numbers in: an array equals no list."""
    return value.tolist() if hasattr(value, "tolist") else value


def _like(current: Parameter, given: Parameter) -> Parameter:
    """Convert a value to the type of the parameter where it is meant so: whole numbers, and lists without elements."""
    kind, value = current.type_, given.value
    if kind == Parameter.Type.DOUBLE and given.type_ == Parameter.Type.INTEGER:
        return Parameter(given.name, kind, float(value))
    if kind.name.endswith("_ARRAY") and given.type_.name.endswith("_ARRAY"):
        if len(value) == 0:
            return Parameter(given.name, kind, [])
        if kind == Parameter.Type.DOUBLE_ARRAY and given.type_ == Parameter.Type.INTEGER_ARRAY:
            return Parameter(given.name, kind, [float(item) for item in value])
    return given


def declare(node: ParameterNode, *classes: type, fixed: Mapping[str, str]) -> list[Any]:
    """Declare the classes' parameters on the node and return them, filled and checked, one object per class.

    Args:
        node: where they are declared.
        *classes: parameter classes.
        fixed: why parameters can't be set later, by shell pattern; those that no pattern fits can be.

    Raises:
        ParameterError: on an unknown name, a wrong type or a value out of range.
    """
    where = node.get_fully_qualified_name()
    own = {cls: specs(cls) for cls in classes}
    known: dict[str, Spec] = {name: spec for found in own.values() for name, spec in found.items()}
    overrides = {name: item for name, item in node._parameter_overrides.items() if not name.startswith(_OF_RCLPY)}
    given = todays_names(overrides, where=where)
    for name in given:
        if name not in known:
            raise ParameterError(f"{where}: {no_parameter(name, known)}")
    values = {name: _plain(known[name], item.value) for name, item in given.items()}
    objects: list[Any] = []
    for cls, found in own.items():
        objects.append(from_mapping(cls, {n: v for n, v in values.items() if n in found}, where=where))
    node.fixed = reasons(known, fixed)
    for name, spec in known.items():
        override = values.get(name, spec.plain_default())
        node.declare_parameter(
            name,
            Parameter(name, _TYPES[spec.type], override).value,
            _descriptor(spec, node.fixed.get(name, "")),
            ignore_override=True,
        )
    return objects


def ros_type(spec: Spec) -> str:
    """Return the name of a parameter's type as ROS does: double, string[] and so on."""
    return str(_TYPES[spec.type].name).lower().replace("_array", "[]")


def refuse_unused_overrides(node: ParameterNode) -> None:
    """Check that whatever was given for a subscription's quality of service has found one; call it once all are made.

    Raises:
        ParameterError: naming what has not.
    """
    for name in node._parameter_overrides:
        if name.startswith(_QOS) and not node.has_parameter(name):
            known = [known for known in node._parameters if known.startswith(_QOS)]
            raise ParameterError(
                f"{node.get_fully_qualified_name()}: no parameter '{name}'{suggestion(name, known) if known else ''}"
            )


def reasons(names: Iterable[str], fixed: Mapping[str, str]) -> dict[str, str]:
    """Return which of the parameters can't be set while a node runs, and why, by the first pattern that fits."""
    found = {name: next((why for pattern, why in fixed.items() if fnmatchcase(name, pattern)), "") for name in names}
    return {name: why for name, why in found.items() if why}


def take_changes(node: Node, current: Any, take: Callable[[Any], None]) -> None:
    """Hand changed parameters to `take` as one checked object; what it or the check refuses is not set.

    Args:
        node: where the parameters were declared.
        current: the object that `declare` gave.
        take: may raise FormationError to refuse.
    """
    cls, where = type(current), node.get_fully_qualified_name()
    known, values = specs(cls), to_mapping(current)

    def on_change(changed: list[Parameter]) -> SetParametersResult:
        new = {item.name: _plain(known[item.name], item.value) for item in changed if item.name in known}
        try:
            take(from_mapping(cls, {**values, **new}, where=where))
        except FormationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        values.update(new)
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(on_change)


def _plain(spec: Spec, value: Any) -> Any:
    """Undo what YAML and rcl make of values: 1 where 1.0 is meant, array('d') where a list is, nothing of [ ]."""
    if value is None and isinstance(spec.default, tuple):
        return []
    value = _bare(value)
    if spec.type is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return list(value) if isinstance(value, (list, tuple)) else value


def _descriptor(spec: Spec, fixed: str) -> ParameterDescriptor:
    unit = f" [{spec.unit}]" if spec.unit else ""
    descriptor = ParameterDescriptor(description=spec.description + unit, read_only=bool(fixed))
    constraints = [f"read-only: {fixed}"] if fixed else []
    if spec.choices:
        also = ", or one from outside the package" if spec.also else ""
        constraints.append("one of: " + ", ".join(map(str, spec.choices)) + also)
    if spec.known:
        constraints.append("known: " + ", ".join(spec.known))
    descriptor.additional_constraints = "; ".join(constraints)
    low, high = spec.low, spec.high
    if low is not None or high is not None:
        if spec.type is int:
            descriptor.integer_range = [
                IntegerRange(
                    from_value=int(-(2**62) if low is None else low), to_value=int(2**62 if high is None else high)
                )
            ]
        elif spec.type is float:
            descriptor.floating_point_range = [
                FloatingPointRange(
                    from_value=-_LARGE if low is None else float(low), to_value=_LARGE if high is None else float(high)
                )
            ]
    return descriptor
