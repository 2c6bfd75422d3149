"""Which of a run's parameters are not the defaults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robot_formation.bag.run_details import node_parameters
from robot_formation.components.catalogue import KINDS
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.json_values import Json
from robot_formation.parameters import specs
from robot_formation.vision.marker import MarkerKind


@dataclass(frozen=True)
class ChangedParameter:
    """A parameter with another value than a node has by itself; the default is None where no such parameter is known.

    Attributes:
        name: NODE.PARAMETER, as `--set` takes it.
        value: in the run.
        default: of the node.
        unit: of both; empty where it has none.
        description: what the parameter is; empty where it is unknown.
    """

    name: str
    value: Json
    default: Json
    unit: str = ""
    description: str = ""


def changed_parameters(details: Mapping[str, str]) -> list[ChangedParameter]:
    """List what a run says of its nodes' parameters that are not today's defaults, by node and name.

    The defaults are those of the nodes' pages: of the parameters' classes and config/NODE.yaml, with what belongs to
    the run's kind of marker.

    Raises:
        FormationError: a file of defaults can't be read.
    """
    nodes = node_parameters(details)
    marker = _marker(nodes.get("world", {}).get("marker.kind"))
    found = []
    for node, values in nodes.items():
        known = specs(KINDS[node].parameter_class()) if node in KINDS else {}
        from_file = node_defaults(node, marker) if known else {}
        for name, value in values.items():
            if name not in known:
                found.append(ChangedParameter(f"{node}.{name}", value, None))
                continue
            spec = known[name]
            default = from_file.get(name, spec.plain_default())
            if value != default:
                found.append(ChangedParameter(f"{node}.{name}", value, default, spec.unit, spec.description))
    return found


def _marker(said: Json) -> MarkerKind:
    return MarkerKind(said) if said in [kind.value for kind in MarkerKind] else MarkerKind.COLOURS
