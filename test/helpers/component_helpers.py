"""What the tests of the components share."""

from typing import Any

from robot_formation import conversions
from robot_formation.components.base import Place
from robot_formation.components.catalogue import KINDS
from robot_formation.names import Topic
from robot_formation.parameters import from_mapping


class Wire:
    """A component with what it sends and says collected, and its inputs by topic name."""

    def __init__(self, component: Any) -> None:
        self.component = component
        self.sent: list[tuple[str, Any]] = []
        self.said: list[tuple[int, str]] = []
        self.inputs = {entry.topic.name: entry.handler for entry in component.inputs()}
        component.attach(self._send, lambda level, text: self.said.append((level, text)))

    def _send(self, topic: Topic, message: Any) -> None:
        assert topic in self.component.outputs(), f"{topic.name} is no output"
        message = conversions.as_message(message, topic.type)
        assert type(message).__name__ == topic.type.rsplit("/", 1)[-1]
        self.sent.append((topic.name, message))

    def give(self, topic: str, message: Any) -> list[tuple[str, Any]]:
        """Hand a message in; return what is sent in answer, by topic name and message."""
        before = len(self.sent)
        self.inputs[topic](message)
        return self.sent[before:]

    @property
    def warnings(self) -> list[str]:
        return [text for level, text in self.said if level == 1]


def wired(kind: str, robot: str = "", /, **values: Any) -> Wire:
    """A component of the catalogue with a robot's place and these parameters."""
    node = KINDS[kind]
    parameters = from_mapping(node.parameter_class(), values, where=kind)
    return Wire(node.component_class()(parameters, Place(robot)))
