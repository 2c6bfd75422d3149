"""Runs a component as an rclpy node: parameters, topics, services, diagnostics, signals, exit code."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.exceptions import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
)
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from std_srvs.srv import SetBool, Trigger

from robot_formation import conversions, exit_codes, names
from robot_formation.components.base import Component, Handler, Place
from robot_formation.components.catalogue import KINDS
from robot_formation.errors import FormationError
from robot_formation.names import Message
from robot_formation.network.loopback import use_loopback
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.help import help_text
from robot_formation.nodes.host.live_transforms import LiveTransforms, transform_topics
from robot_formation.nodes.host.living_nodes import node_names
from robot_formation.nodes.host.outbox import Outbox
from robot_formation.nodes.host.qos import qos_profile
from robot_formation.nodes.host.repetition import Repetitions
from robot_formation.nodes.host.ros_parameters import (
    AT_START,
    HostParameters,
    ParameterNode,
    declare,
    refuse_unused_overrides,
    take_changes,
)
from robot_formation.nodes.host.signals import bounded_end, ignore_signals, says_farewell, stopped, woken_by_signals
from robot_formation.parameters import specs

_IDLE_S = 1.0  # how long a node waits for a message at most; signals end the wait
_LOOK_S = 0.03  # how often a node looks for those that it waits for
_HELD_BACK_S = 0.01  # how often it looks for listeners while messages are held back
_DIAGNOSTICS_S = 1.0
_ACKNOWLEDGED_S, _ACKNOWLEDGED_BY_MANY_S = 2.0, 0.5
"""How long a node makes sure at its end that its messages have arrived. Where all end without leaving the graph, those
that have ended already never acknowledge."""
_BAD_INPUT = (FormationError, InvalidParameterException, InvalidParameterTypeException, InvalidParameterValueException)


def main_of(kind: str) -> int:
    """Run the node of this kind until it ends; return its exit code (0 done, 2 bad parameter, or the component's)."""
    return run_node(kind, lambda node: Host(node, kind))


class Runnable(Protocol):
    """What runs on a node until it ends."""

    def run(self) -> int:
        """Run; return the exit code."""


def run_node(name: str, make: Callable[[ParameterNode], Runnable]) -> int:
    """Make a node and what runs on it, run and clean up; errors from outside become one line.

    Returns:
        The exit code: 2 if what was given at the start is bad, 1 for such an error later, else that of the run.
    """
    if {"-h", "--help"} & set(sys.argv[1:]):
        with contextlib.suppress(BrokenPipeError):
            os.write(sys.stdout.fileno(), (help_text(name) + "\n").encode())
        return exit_codes.DONE
    node, running = None, False
    try:
        use_loopback(os.environ)
        # ROS's own handlers would invalidate the context at once, and lose what is still to be sent.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = ParameterNode(name)
        body = make(node)
        running = True
        return body.run()
    except _BAD_INPUT as error:
        print(_complaint(name, str(error)), file=sys.stderr)
        return exit_codes.ERROR if running else exit_codes.BAD_INPUT
    except Exception as error:
        if type(error).__name__ not in ("RCLError", "RCLInvalidROSArgsError", "UnknownROSArgsError"):
            raise
        print(f"{name}: {str(error).splitlines()[0]}", file=sys.stderr)
        return exit_codes.BAD_INPUT
    finally:
        if says_farewell():
            with bounded_end():
                if node is not None:
                    node.destroy_node()
                try_shutdown()
        ignore_signals()


def _complaint(name: str, text: str) -> str:
    """Return a message with the node's name before it, unless it begins with it, or with the node's full name."""
    who = text.partition(":")[0]
    return text if who.rpartition("/")[2] == name else f"{name}: {text}"


class Host:
    """Connects one component to one rclpy node."""

    def __init__(self, node: ParameterNode, kind: str) -> None:
        self._node = node
        entry = KINDS[kind]
        own, component_class = entry.parameter_class(), entry.component_class()
        fixed = {**dict.fromkeys(specs(HostParameters), AT_START), **component_class.fixed}
        parameters, self._parameters = declare(node, own, HostParameters, fixed=fixed)
        robot = node.get_namespace().strip("/").rpartition("/")[2]
        if entry.robots and not robot:
            raise FormationError(
                f"{kind}: it belongs to a robot: give its name as namespace, --ros-args -r __ns:=/follower_1"
            )
        home = node.get_namespace().rpartition("/")[0] if entry.robots else node.get_namespace()
        place = Place(robot if entry.robots else "", names.absolute(home, self._parameters.formation_namespace), home)
        self._pacer = Pacer(getattr(parameters, "real_time_factor", 0.0))
        self._component: Component = component_class(parameters, place)
        self._component.wall_clock = time.perf_counter
        take_changes(node, parameters, self._set_parameters)
        self._outbox = Outbox(
            node,
            patience_s=self._parameters.wait_for_listeners_s,
            recorder=names.absolute(home, self._parameters.recorder) if self._parameters.recorder else "",
            record_images=self._parameters.record_images,
            warn=self._component.warn,
        )
        self._component.attach(self._send, self._say)
        self._repetitions = Repetitions()
        self._transform_topics = transform_topics() if kind == "world" else []
        self._transforms = LiveTransforms(node.get_namespace()) if self._transform_topics else None
        self._publishers: dict[names.Topic, Message] = {}
        awaited = [names.absolute(home, name) for name in self._parameters.wait_for_nodes]
        self._awaited = [name for name in awaited if name != node.get_fully_qualified_name()]
        self._heard_s = time.monotonic()
        self._failure: FormationError | None = None
        self._connect()

    def _connect(self) -> None:
        node = self._node
        for topic in [*self._component.outputs(), *self._transform_topics]:
            publisher = node.create_publisher(conversions.message_class(topic.type), topic.name, qos_profile(topic.qos))
            self._publishers[topic] = publisher
            self._outbox.add(topic, publisher)
        for entry in self._component.inputs():
            self._subscribe(entry.topic, self._heard(entry.handler))
        refuse_unused_overrides(node)
        for name, service in self._component.services().items():
            node.create_service(Trigger, name, partial(_trigger, service))
        for name, switch in self._component.switches().items():
            node.create_service(SetBool, name, partial(_switch, switch))
        health = names.DIAGNOSTICS
        self._health = node.create_publisher(
            conversions.message_class(health.type), health.name, qos_profile(health.qos)
        )
        # Wall time: with use_sim_time a node's own clock stands while nobody moves.
        node.create_timer(_DIAGNOSTICS_S, self._publish_health, clock=Clock(clock_type=ClockType.STEADY_TIME))
        if self._component.patience_s > 0.0:
            node.create_timer(_DIAGNOSTICS_S, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _subscribe(self, topic: names.Topic, handler: Handler) -> None:
        message_class = conversions.message_class(topic.type)
        # Volatile: a node that joins late must not act on what was said before.
        qos = qos_profile(replace(topic.qos, durability="volatile"))
        # A camera's driver may be best effort: its user may ask for less.
        options = QoSOverridingOptions.with_default_policies() if topic.type == names.IMAGE_TYPE else None
        try:
            self._node.create_subscription(message_class, topic.name, handler, qos, qos_overriding_options=options)
        except RuntimeError as error:  # rclpy's own, for an override that is no value of its policy
            raise FormationError(f"{self._node.get_fully_qualified_name()}: {error}") from None

    def run(self) -> int:
        """Spin until the component finishes or a signal comes; then make sure that everything sent has arrived."""
        self._await_nodes()
        executor = make_executor()
        executor.add_node(self._node)
        component = self._component
        if not stopped():
            component.start()
            self._say(0, self._ready())
        try:
            with woken_by_signals(lambda: executor.create_task(_do_nothing)):
                self._work_until_done(executor)
            if component.exit_code or component.held_code:
                self._say(0, component.exit_reason or component.held_reason)
            elif component.exit_code is not None:
                self._say(0, component.exit_reason)
            self._publish_health()
        finally:
            # A listener that was killed never acknowledges.
            end = time.monotonic() + (_ACKNOWLEDGED_S if says_farewell() else _ACKNOWLEDGED_BY_MANY_S)
            for publisher in (*self._publishers.values(), self._health):
                publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - time.monotonic())))
            executor.shutdown()
            component.close()
        return component.exit_code or component.held_code

    def _work_until_done(self, executor: Executor) -> None:
        component, outbox = self._component, self._outbox
        while not stopped() and (component.exit_code is None or outbox.waiting):
            outbox.flush()
            busy = component.busy and not outbox.waiting
            idle_s = _HELD_BACK_S if outbox.waiting else _IDLE_S
            with contextlib.suppress(ExternalShutdownException):
                executor.spin_once(min(self._pacer.left_s, idle_s) if busy else idle_s)
            if self._failure is not None:
                raise self._failure
            ready = component.busy and not outbox.waiting and component.exit_code is None
            if ready and self._pacer.left_s <= 0.0:
                component.work()
                self._pacer.worked(component.stamp_ns)

    def _await_nodes(self) -> None:
        """Wait until the nodes without which this one may not begin are there; messages are kept meanwhile."""
        missing = self._awaited
        if missing:
            self._say(0, f"waiting for {', '.join(missing)}")
        while missing and not stopped():
            time.sleep(_LOOK_S)
            present = node_names(self._node)
            missing = [name for name in missing if name not in present]
        self._heard_s = time.monotonic()

    def _send(self, topic: names.Topic, message: Message) -> None:
        # Transforms first: a recorder that gets the message has found their topics, and makes none of its own.
        if self._transforms is not None:
            for name, cdr in self._transforms.of(topic, message):
                self._outbox.send(name, cdr)
        self._outbox.send(topic, message)

    def _heard(self, handler: Handler) -> Handler:
        def noted(message: Message) -> None:
            self._heard_s = time.monotonic()
            try:
                handler(message)
            except FormationError as error:  # raised by `run`: the executor would log it in several lines of its own
                self._failure = error

        return noted

    def _watch(self) -> None:
        """Watchdog: tell a component that has heard nothing for so long."""
        now = time.monotonic()
        if now - self._heard_s > self._component.patience_s and self._component.exit_code is None:
            self._heard_s = now
            self._component.stalled()

    def _set_parameters(self, parameters: Any) -> None:
        self._component.set_parameters(parameters)
        self._pacer.factor = getattr(parameters, "real_time_factor", 0.0)

    def _ready(self) -> str:
        topics = ", ".join(entry.topic.name for entry in self._component.inputs())
        return f"ready, waiting for {topics}" if topics else "ready"

    def _say(self, level: int, said: str) -> None:
        logger = self._node.get_logger()
        text = self._repetitions.line(said) if level else said
        if text is None:
            return
        # One line each: rclpy refuses different severities from the same line.
        if level == 0:
            logger.info(text)
        elif level == 1:
            logger.warning(text)
        else:
            logger.error(text)

    def _publish_health(self) -> None:
        for topic, publisher in self._publishers.items():
            if not topic.listeners and topic.type == names.IMAGE_TYPE:
                self._component.listened_to(topic, publisher.get_subscription_count())
        health = self._component.health()
        name = self._node.get_fully_qualified_name()
        stamp_ns = self._component.stamp_ns
        self._health.publish(conversions.diagnostics(name, health.level, health.text, health.values, stamp_ns))


def _do_nothing() -> None:
    """Do nothing: `spin_once` returns after any task."""


def _trigger(service: Callable[[], tuple[bool, str]], request: Message, response: Message) -> Message:
    response.success, response.message = service()
    return response


def _switch(switch: Callable[[bool], tuple[bool, str]], request: Message, response: Message) -> Message:
    response.success, response.message = switch(request.data)
    return response


class Pacer:
    """Holds simulated time to a multiple (`factor`) of wall time; a factor of 0 never waits.

    It says how long to wait and doesn't sleep itself: in slow motion a node goes on answering and reporting.
    """

    def __init__(self, factor: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.factor = factor
        self._clock = clock
        self._due_s: float | None = None
        self._simulated_ns = 0

    @property
    def left_s(self) -> float:
        """Wall seconds that the next piece of work has to wait."""
        if self.factor <= 0.0 or self._due_s is None:
            return 0.0
        return max(0.0, self._due_s - self._clock())

    def worked(self, stamp_ns: int) -> None:
        """Register the simulated time reached. Standing still doesn't build up credit to be made good later."""
        step_ns = stamp_ns - self._simulated_ns
        self._simulated_ns = stamp_ns
        if self.factor <= 0.0:
            self._due_s = None
            return
        now = self._clock()
        step_s = step_ns * 1e-9 / self.factor
        self._due_s = max(now, (self._due_s or now) + step_s)
