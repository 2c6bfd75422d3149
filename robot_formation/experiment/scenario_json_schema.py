"""A JSON Schema of scenario files, by which editors complete and check them; config/scenario.schema.json holds it."""

from __future__ import annotations

from robot_formation.components.catalogue import KINDS
from robot_formation.experiment.scenario_setup import FOLLOWS_FROM_SETUP, Setup
from robot_formation.parameters import LENGTH_PAIRS, LIST_ELEMENTS, ROWS, Spec, specs

_TYPES: dict[object, dict[str, object]] = {
    bool: {"type": "boolean"},
    int: {"type": "integer"},
    float: {"type": "number"},
    str: {"type": "string"},
}


def scenario_schema() -> dict[str, object]:
    """Return the schema: the setup's entries, and one object per node with its parameters."""
    nodes = {}
    for name, kind in KINDS.items():
        follows = FOLLOWS_FROM_SETUP.get(name, {})
        own = [spec for spec in specs(kind.parameter_class()).values() if spec.name not in follows]
        nodes[name] = {"description": f"Parameters of the {name} node", **_group(own, "")}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Scenario of robot_formation",
        "type": "object",
        "additionalProperties": False,
        "properties": {**{name: _property(spec) for name, spec in specs(Setup).items()}, **nodes},
    }


def _group(found: list[Spec], prefix: str) -> dict[str, object]:
    """Describe the parameters below a prefix; names with dots are allowed too, for editors unchecked."""
    properties: dict[str, object] = {}
    for spec in found:
        name, dot, _ = spec.name.removeprefix(prefix).partition(".")
        if not dot:
            properties[name] = _property(spec)
        elif name not in properties:
            inner = f"{prefix}{name}."
            properties[name] = _group([other for other in found if other.name.startswith(inner)], inner)
    return {
        "type": ["object", "null"],
        "additionalProperties": False,
        "patternProperties": {r"\.": {}},
        "properties": properties,
    }


def _property(spec: Spec) -> dict[str, object]:
    unit = f" [{spec.unit}]" if spec.unit else ""
    said = {"description": spec.description + unit, "default": spec.plain_default()}
    if spec.type == LENGTH_PAIRS:
        pair = {"type": "array", "items": {**_TYPES[float], **_limits(spec)}, "minItems": 2, "maxItems": 2}
        return {**said, "type": "array", "items": pair}
    if spec.type == ROWS:
        row = {"type": "array", "items": {"type": ["number", "string"]}, "minItems": 2, "maxItems": 4}
        return {**said, "type": "array", "items": row}
    if spec.type in LIST_ELEMENTS:
        return {**said, "type": "array", "items": {**_TYPES[LIST_ELEMENTS[spec.type]], **_limits(spec)}}
    return {**said, **_TYPES[spec.type], **_limits(spec)}


def _limits(spec: Spec) -> dict[str, object]:
    limits: dict[str, object] = {}
    if spec.choices and not spec.also:
        limits["enum"] = list(spec.choices)
    if examples := spec.known or (spec.choices if spec.also else ()):
        limits["examples"] = list(examples)
    if spec.low is not None:
        limits["minimum"] = spec.low
    if spec.high is not None:
        limits["maximum"] = spec.high
    return limits
