"""The executor of all our nodes: one thread, callbacks one at a time."""

from __future__ import annotations

from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor

try:
    from rclpy.experimental.events_executor import EventsExecutor
except ImportError:
    EventsExecutor = None  # type: ignore[assignment, misc]


def make_executor(context: Context | None = None) -> Executor:
    """Make rclpy's event-driven executor where this rclpy has it, else the stock single-threaded one.

    The stock one builds a wait set of all entities for every callback; the event-driven one costs about an eighth
    (bench/executors.py), which decides how fast a run of small messages goes.
    """
    if EventsExecutor is None:
        return SingleThreadedExecutor(context=context)
    executor: Executor = EventsExecutor(context=context)
    return executor
