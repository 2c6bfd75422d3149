"""Quality of service of publishers that are already there: what to ask of them, and how a bag describes it."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robot_formation.bag.qos import TopicQos


def accepting(infos: Sequence[TopicEndpointInfo]) -> QoSProfile:
    """Ask for the best that every publisher of a topic offers, and keep all of it."""
    reliable = all(info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in infos)
    latched = all(info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for info in infos)
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def accepts(subscribed: QoSProfile, info: TopicEndpointInfo) -> bool:
    """Return whether a subscription gets what a publisher sends."""
    offered = info.qos_profile
    if subscribed.reliability == ReliabilityPolicy.RELIABLE and offered.reliability != ReliabilityPolicy.RELIABLE:
        return False
    latched = DurabilityPolicy.TRANSIENT_LOCAL
    return bool(subscribed.durability != latched or offered.durability == latched)


def offered(info: TopicEndpointInfo) -> TopicQos:
    """Describe what a publisher offers; history and depth are not known of other processes (`unknown`, 0)."""
    profile = info.qos_profile
    return TopicQos(
        profile.history.name.lower(),
        profile.depth,
        profile.reliability.name.lower(),
        profile.durability.name.lower(),
        profile.deadline.nanoseconds,
        profile.lifespan.nanoseconds,
        profile.liveliness.name.lower(),
        profile.liveliness_lease_duration.nanoseconds,
        profile.avoid_ros_namespace_conventions,
    )
