"""Microseconds per callback of rclpy's two single-threaded executors, in the same run.

A node publishes to itself; each callback publishes the next message, so every one goes through the executor alone.

Run: python bench/executors.py [--messages N]
"""

import argparse
import os
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import UInt32

from comparison import Comparison, add_comparisons, as_json
from robot_formation.network.ros_domain import DomainReservation
from robot_formation.nodes.host.executor import make_executor


def microseconds_per_callback(make: Callable[..., Executor], domain: int, messages: int) -> float:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node("executor_bench", context=context)
    executor = make(context=context)
    executor.add_node(node)
    publisher = node.create_publisher(UInt32, "number", 10)
    last = 0

    def take(message: Any) -> None:
        nonlocal last
        last = message.data
        if last < messages:
            publisher.publish(UInt32(data=last + 1))

    node.create_subscription(UInt32, "number", take, 10)
    while publisher.get_subscription_count() == 0:
        executor.spin_once(0.05)
    began = time.perf_counter()
    publisher.publish(UInt32(data=1))
    while last < messages:
        executor.spin_once(0.1)
    elapsed = time.perf_counter() - began
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)
    return elapsed / messages * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=5000)
    add_comparisons(parser)
    args = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with DomainReservation() as domain:
        stock = microseconds_per_callback(SingleThreadedExecutor, domain, args.messages)
        ours = microseconds_per_callback(make_executor, domain, args.messages)
    if args.comparisons:
        print(as_json([Comparison("callback", ours, stock, "us", "rclpy's SingleThreadedExecutor")]))
        return
    print(f"SingleThreadedExecutor {stock:.1f} us, ours {ours:.1f} us per callback: {stock / ours:.1f} times faster")


if __name__ == "__main__":
    main()
