"""What the parameters of the other nodes are, for a bag's metadata."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial

from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future

KEY = "parameters of "
"""What the keys in the metadata begin with; the node's full name follows."""


class ParameterSnapshot:
    """Asks every node that appears for its parameters, once, without waiting for it.

    Args:
        node: the one that asks; call `look` from its executor now and then.
        tell: called with a key and a JSON mapping of parameter names to values, once per node that answers.
    """

    def __init__(self, node: Node, tell: Callable[[str, str], None]) -> None:
        self._node = node
        self._tell = tell
        self._asked: dict[str, AsyncParameterClient] = {}
        self._listed: set[str] = set()

    def look(self) -> None:
        """Ask nodes that are new, and those that were not ready before."""
        own = self._node.get_fully_qualified_name()
        for name, namespace in self._node.get_node_names_and_namespaces():
            full = f"{namespace.rstrip('/')}/{name}"
            if full == own or name.startswith("_") or full in self._listed:
                continue
            client = self._asked.setdefault(full, AsyncParameterClient(self._node, full))
            if client.services_are_ready():
                self._listed.add(full)
                client.list_parameters(callback=partial(self._on_names, full))

    def _on_names(self, full: str, future: Future) -> None:
        names = list(future.result().result.names) if future.result() is not None else []
        if names:
            self._asked[full].get_parameters(names, callback=partial(self._on_values, full, names))

    def _on_values(self, full: str, names: list[str], future: Future) -> None:
        if future.result() is None:
            return
        values = [parameter_value_to_python(value) for value in future.result().values]
        plain = {
            name: value.tolist() if hasattr(value, "tolist") else value
            for name, value in zip(names, values, strict=False)
        }
        self._tell(KEY + full, json.dumps(plain, default=str))
