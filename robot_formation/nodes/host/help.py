"""What a node prints for --help: what it is for, how it is started, its topics, services and parameters."""

from __future__ import annotations

import importlib
import inspect
import textwrap
from collections.abc import Iterable

from robot_formation import names
from robot_formation.components.base import Component, Place
from robot_formation.components.catalogue import KINDS
from robot_formation.nodes.host.ros_parameters import HostParameters, ros_type
from robot_formation.parameters import Spec, specs

_WIDTH = 110
# Nodes without a component: module, its class of parameters, and what is read and written.
_OTHERS = {
    "recorder": (
        "recorder.recorder_node",
        (("reads", "any topic that has a publisher"), ("writes", names.DIAGNOSTICS.name)),
    ),
    "player": ("player.player_node", (("writes", "the topics of the bag"),)),
    "progress": (
        "progress.progress_node",
        (
            ("reads", "ground_truth/<robot>/pose"),
            ("reads", "<robot>/moved"),
            ("reads", "<follower>/displacement and alignment"),
        ),
    ),
    "viewer": (
        "viewer.viewer_node",
        (
            ("reads", "surface"),
            ("reads", "ground_truth/<robot>/odom, pose and path"),
            ("reads", "<robot>/robot_description, joint_states and moved"),
            ("reads", "<follower>/displacement, prediction and alignment"),
            ("reads", "<follower>/camera/image_raw, camera/camera_info and blocks"),
            ("calls", "world/pause, world/step and world/set_parameters, when people ask for it"),
        ),
    ),
}


def help_text(name: str) -> str:
    """Describe the node of this name in lines of text."""
    parameters: list[Spec] = []
    if name in KINDS:
        kind = KINDS[name]
        own = kind.parameter_class()
        robot = {"": "", "leader": names.LEADER}.get(kind.robots, names.follower(1))
        component: Component = kind.component_class()(own(), Place(robot))
        try:
            module, facts = inspect.getmodule(type(component)), list(_facts(component))
        finally:
            component.close()
        parameters += [*specs(own).values(), *specs(HostParameters).values()]
    else:
        stem, facts = _OTHERS[name][0], [f"  {verb:8} {what}" for verb, what in _OTHERS[name][1]]
        module = importlib.import_module(f"robot_formation.nodes.{stem}")
        parameters += specs(getattr(module, f"{name.capitalize()}Parameters")).values()
        if name == "recorder":
            parameters += specs(HostParameters).values()
        robot = ""
    purpose = (inspect.getdoc(module) or "").splitlines()[0]
    place = f" -r __ns:=/{robot}" if robot else ""
    arguments = f"--ros-args{place} [-p NAME:=VALUE ...] [--params-file FILE]"
    lines = [purpose, "", f"usage: ros2 run robot_formation {name} {arguments}"]
    lines += [f"   or: python -m robot_formation.nodes {name} {arguments}", "", "topics and services", *facts, ""]
    lines += ["parameters", *(line for spec in parameters for line in _parameter(spec))]
    return "\n".join(lines)


def _facts(component: Component) -> Iterable[str]:
    for entry in component.inputs():
        yield f"  reads    {entry.topic.name} ({entry.topic.type})"
    for topic in [*component.outputs(), names.DIAGNOSTICS]:
        yield f"  writes   {topic.name} ({topic.type})"
    for service in component.services():
        yield f"  service  {service} (std_srvs/srv/Trigger)"
    for service in component.switches():
        yield f"  service  {service} (std_srvs/srv/SetBool)"


def _parameter(spec: Spec) -> Iterable[str]:
    default = spec.plain_default()
    shown = repr(default) if isinstance(default, str) else str(default)
    unit = f" {spec.unit}" if spec.unit else ""
    limits = ""
    if spec.choices:
        limits = f"; one of {', '.join(map(str, spec.choices))}"
    elif spec.known:
        limits = f"; known: {', '.join(spec.known)}"
    elif spec.low is not None or spec.high is not None:
        low, high = ("-inf" if spec.low is None else spec.low), ("inf" if spec.high is None else spec.high)
        limits = f"; {low} to {high}{unit}"
    head = f"  {spec.name} ({ros_type(spec)}, {shown}{unit}{limits})"
    yield from textwrap.wrap(head, _WIDTH, subsequent_indent="    ")
    yield from textwrap.wrap(spec.description, _WIDTH, initial_indent="      ", subsequent_indent="      ")
