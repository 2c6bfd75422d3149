"""Quality of service between rclpy, bags and publishers that are already there."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robot_formation.bag.qos import TopicQos

# What a best-effort publisher keeps: more than any burst of a bag needs.
_BEST_EFFORT_DEPTH = 100


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
    """Tell whether a subscription gets what a publisher sends."""
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


def republishing(profiles: Sequence[TopicQos]) -> QoSProfile:
    """Offer what a recorded topic's publishers offered, and drop nothing where that is possible.

    A subscriber that was served by one of the publishers is served again: the topic is reliable or transient local if
    any of them was. Reliable topics keep all, but for those that kept the last few for late subscribers: these get
    what they would have got.
    """
    reliable = not profiles or any(profile.reliability != "best_effort" for profile in profiles)
    latched = any(profile.durability == "transient_local" for profile in profiles)
    limited = latched and all(profile.history == "keep_last" and profile.depth > 0 for profile in profiles)
    depth = max((profile.depth for profile in profiles), default=0) if limited else _BEST_EFFORT_DEPTH
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST if limited or not reliable else HistoryPolicy.KEEP_ALL,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
