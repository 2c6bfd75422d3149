"""A node inside a command-line verb: the user's ROS domain, one-line errors, and nothing left behind."""

from __future__ import annotations

import contextlib
import gc
import os
from collections.abc import Iterator
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException, InvalidNodeNameException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from robot_formation.errors import FormationError
from robot_formation.network.loopback import stay_here
from robot_formation.network.shared_memory import TracingFiles


@contextlib.contextmanager
def node_session(name: str, *, namespace: str = "", **options: Any) -> Iterator[Node]:
    """Join the ROS graph of the environment (ROS_DOMAIN_ID and the like) as one node; signals stay with the caller.

    Where the environment doesn't say how far discovery reaches, it is this machine.

    Args:
        name: the node's name.
        namespace: its namespace.
        **options: as for rclpy's Node.

    Raises:
        FormationError: the graph can't be joined (a bad ROS_DOMAIN_ID, a middleware that isn't installed).
    """
    tracing = TracingFiles()
    stay_here(os.environ)
    context = Context()
    node = None
    try:
        try:
            rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
            node = Node(name, namespace=namespace, context=context, **options)
        except (InvalidNamespaceException, InvalidNodeNameException) as error:
            raise FormationError(" ".join(str(error).split())) from error
        except Exception as error:
            if type(error).__name__ not in ("RCLError", "RCLInvalidROSArgsError"):
                raise
            reason = str(error).splitlines()[0]
            raise FormationError(
                f"can't join the ROS graph: {reason}; 'formation doctor' looks for the cause"
            ) from error
        yield node
    finally:
        if node is not None:
            node.destroy_node()
        if context.ok():
            rclpy.shutdown(context=context)
        # The shared memory of this participant is given back with the last reference, and rclpy's objects form cycles.
        del node, context
        gc.collect()
        tracing.remove_new()
