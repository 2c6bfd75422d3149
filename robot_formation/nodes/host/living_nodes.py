"""Which nodes a run's graph has."""

from __future__ import annotations

import contextlib

from rclpy.node import Node, NodeNameNonExistentError

from robot_formation import names


def node_names(node: Node) -> set[str]:
    """Return the full names of the nodes in a node's graph that have a publisher or a subscription.

    One without has gone: the middleware may list it for good if its last words came after its farewell.
    """
    found = set()
    for name, namespace in node.get_node_names_and_namespaces():
        with contextlib.suppress(NodeNameNonExistentError):
            if node.get_publisher_names_and_types_by_node(
                name, namespace
            ) or node.get_subscriber_names_and_types_by_node(name, namespace):
                found.add(names.absolute(namespace, name))
    return found
