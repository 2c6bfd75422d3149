"""A node's body without rclpy: what it listens to, what it sends, what it does.

The node graph hosts a component in an rclpy node (nodes/host/component_node.py), the in-process runner on a queue
(experiment/in_process.py). Both hand it the same messages, so both give the same run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from robot_formation.names import Message, Topic

Handler = Callable[[Message], None]


@dataclass(frozen=True)
class Input:
    """A subscription: the topic and the method that takes its messages."""

    topic: Topic
    handler: Handler


@dataclass(frozen=True)
class Health:
    """What a component says of itself on /diagnostics: level 0 OK, 1 warning, 2 error."""

    level: int
    text: str
    values: Mapping[str, str]


@dataclass(frozen=True)
class Place:
    """Where a component runs: its robot ('' for the run's own nodes), the namespace of the formation's ticks, and the
    one in which world and robots lie ('': the root).
    """

    robot: str
    formation: str = "/formation"
    home: str = ""

    def frame(self, name: str) -> str:
        """Return the name of one of the robot's frames."""
        return f"{self.robot}/{name}" if self.robot else name


class Component:
    """Base of all components. The host calls `attach` once, then `start`, then the inputs' handlers in order.

    A component that has finished sets `exit_code`; its host then ends with it. One that has failed, but stays for the
    sake of the others, sets `held_code`, with which its host ends when the run does. A host that reports health gives a
    `wall_clock` (seconds, from any origin), to measure how long work takes and for nothing else. One that knows that
    nobody will ever hear some outputs says so by `wanted(topic)`; what is costly to make isn't made for them. What is
    sent may be serialised already (`bytes`): hosts give receivers the message.
    """

    fixed: ClassVar[Mapping[str, str]] = {"*": "a run's results rest on it from the start on"}
    """Which parameters can't be set after the start, by shell pattern, and why; `set_parameters` takes the others."""
    patience_s = 0.0
    """Wall time without any message after which a host calls `stalled`, seconds; 0: never."""

    def __init__(self, place: Place) -> None:
        self.place = place
        self.exit_code: int | None = None
        self.exit_reason = ""
        self.held_code = 0
        self.held_reason = ""
        self.stamp_ns = 0
        self.wall_clock: Callable[[], float] | None = None
        self.wanted: Callable[[Topic], bool] = lambda topic: True
        self._send: Callable[[Topic, Message], None] = _not_attached
        self._say: Callable[[int, str], None] = lambda level, text: None
        self._warnings = 0
        self._last_warning = ""

    def attach(self, send: Callable[[Topic, Message], None], say: Callable[[int, str], None]) -> None:
        """Connect: `send(topic, message)` publishes, `say(level, text)` logs (0 info, 1 warning, 2 error)."""
        self._send = send
        self._say = say

    def inputs(self) -> list[Input]:
        """List the subscriptions."""
        return []

    def outputs(self) -> list[Topic]:
        """List the topics that may be sent."""
        return []

    def services(self) -> dict[str, Callable[[], tuple[bool, str]]]:
        """List the std_srvs/Trigger services by relative name; each returns success and a message."""
        return {}

    def switches(self) -> dict[str, Callable[[bool], tuple[bool, str]]]:
        """List the std_srvs/SetBool services by relative name; each takes the value and answers like a Trigger."""
        return {}

    def set_parameters(self, parameters: Any) -> None:
        """Apply changed parameters, an object of the component's parameter class, in which those `fixed` are as before.

        Raises:
            FormationError: to refuse them.
        """

    def start(self) -> None:
        """Begin: called once after everything is connected."""

    def listened_to(self, topic: Topic, listeners: int) -> None:
        """Register how many listen to an output that is worth making only for somebody."""

    @property
    def busy(self) -> bool:
        """Whether `work` has something to do without any further message. Only the world ever has."""
        return False

    def work(self) -> None:
        """Do the next piece of what is owed."""

    def stalled(self) -> None:
        """Do something about it that nothing comes any more."""

    def close(self) -> None:
        """Release what the component holds; called once, at the end."""

    def health(self) -> Health:
        """Report what /diagnostics shows; by default the last warning."""
        values = {"warnings": str(self._warnings), **self.details()}
        return Health(1 if self._warnings else 0, self._last_warning or "ok", values)

    def details(self) -> dict[str, str]:
        """List what /diagnostics shows beside the warnings."""
        return {}

    def warn(self, text: str) -> None:
        """Log a warning, count it and show it on /diagnostics."""
        self._warnings += 1
        self._last_warning = text
        self._say(1, text)

    def finish(self, exit_code: int, reason: str) -> None:
        """End the component's work; its host ends in good order."""
        self.exit_code, self.exit_reason = exit_code, reason

    def hold(self, exit_code: int, reason: str) -> None:
        """Go on for the sake of the others, but end with this code once the run does."""
        self.held_code, self.held_reason = exit_code, reason
        self.warn(reason)


def _not_attached(topic: Topic, message: Message) -> None:
    raise RuntimeError(f"nothing is connected to {topic.name}")
