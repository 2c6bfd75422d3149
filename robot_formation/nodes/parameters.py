"""Declares a parameter dataclass on an rclpy node: descriptors, ranges, and errors for what is not in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from robot_formation.errors import FormationError
from robot_formation.names import FORMATION
from robot_formation.parameters import ParameterError, Spec, from_mapping, parameter, specs, suggestion, to_mapping

T = TypeVar("T")

# What rclpy itself declares or reads on every node.
_OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides.")
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


@dataclass(frozen=True)
class HostParameters:
    """What every node has beside its own parameters."""

    formation: str = parameter(FORMATION, "Namespace of the formation's done ticks")
    wait_for_listeners_s: float = parameter(
        5.0, "How long a first message is held back for its listeners to appear", unit="s", low=0.0, high=3600.0
    )
    recorder: str = parameter("", "Name of a recorder that must listen too before anything is sent; empty: none")
    record_images: bool = parameter(False, "Whether that recorder records images")
    callback_delay_s: float = parameter(
        0.0,
        "Longest random delay before each callback, to show that results don't depend on it",
        unit="s",
        low=0.0,
        high=10.0,
    )


def declare(node: Node, *classes: type, settable: tuple[type, ...] = ()) -> list[Any]:
    """Declare the classes' parameters on the node and return them, filled and checked, one object per class.

    Those of the classes in `settable` can be changed later, the others are read-only.

    Raises:
        ParameterError: on an unknown name, a wrong type or a value out of range.
    """
    where = node.get_fully_qualified_name()
    known: dict[str, Spec] = {}
    for cls in classes:
        known.update(specs(cls))
    given = {name: value for name, value in node._parameter_overrides.items() if not name.startswith(_OF_RCLPY)}
    for name in given:
        if name not in known:
            raise ParameterError(f"{where}: no parameter '{name}'{suggestion(name, known)}")
    values = {name: _plain(known[name], item.value) for name, item in given.items()}
    objects: list[Any] = []
    for cls in classes:
        objects.append(from_mapping(cls, {n: v for n, v in values.items() if n in specs(cls)}, where=where))
    writable = {name for cls in settable for name in specs(cls)}
    for name, spec in known.items():
        default = list(spec.default) if isinstance(spec.default, tuple) else spec.default
        override = values.get(name, default)
        node.declare_parameter(
            name,
            Parameter(name, _TYPES[spec.type], override).value,
            _descriptor(spec, name not in writable),
            ignore_override=True,
        )
    return objects


def take_changes(node: Node, current: Any, take: Callable[[Any], None]) -> None:
    """Hand changed parameters to `take` as one checked object; what it or the check refuses is not set.

    Args:
        node: where the parameters were declared as settable.
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
    if hasattr(value, "tolist"):
        value = value.tolist()
    if spec.type is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return list(value) if isinstance(value, (list, tuple)) else value


def _descriptor(spec: Spec, read_only: bool) -> ParameterDescriptor:
    unit = f" [{spec.unit}]" if spec.unit else ""
    descriptor = ParameterDescriptor(description=spec.description + unit, read_only=read_only)
    if spec.choices:
        descriptor.additional_constraints = "one of: " + ", ".join(map(str, spec.choices))
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
