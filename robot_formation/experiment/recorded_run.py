"""What a run's bag holds, for running it again: followers, messages as ROS has them, and the nodes' parameters."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from robot_formation import conversions, names
from robot_formation.bag.errors import BagError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.provenance import versions
from robot_formation.bag.reader import Bag
from robot_formation.bag.run_details import mapping, node_parameters, said_slots
from robot_formation.components.base import Component, Place
from robot_formation.components.catalogue import KINDS
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.json_values import JsonObject
from robot_formation.names import Message
from robot_formation.parameters import from_mapping, specs
from robot_formation.system.git_commit import git_commit


class Recording:
    """An open bag of a run.

    Attributes:
        followers: names of the followers whose topics are in it, by number.
        notes: what a reader should know: parameters and versions that were other ones.
    """

    def __init__(self, opened: Bag, namespace: str | None = None) -> None:
        """Choose the run's formation: the one in this namespace ('/': the root), None: wherever there is one.

        Raises:
            BagError: there is none, or there are several to choose from.
        """
        bag = self._bag = FormationBag(opened, namespace)
        numbers = {int(match[1]) for topic in bag.topics if (match := re.match(r"/follower_([1-9]\d*)/", topic))}
        self.followers = [names.follower(number) for number in sorted(numbers)]
        if not self.followers:
            raise BagError(f"{bag.path} has no topics of a follower; give the bag of 'formation run'")
        details = bag.metadata(METADATA_NAME)
        self._parameters = node_parameters(details)
        self._slots = said_slots(details)
        self._own_blackouts = mapping(details, "own_blackouts")
        self.notes = _changes({**mapping(details, "versions"), "commit": details.get("git_commit", "")})
        if not self._parameters:
            self.notes.append("the bag doesn't tell the nodes' parameters: the defaults are taken")

    def has(self, robot: str, topic: names.Topic) -> bool:
        """Return whether there are messages on a robot's topic."""
        return topic.of(robot) in self._bag.topics

    def messages(self, robot: str, topic: names.Topic) -> Iterator[Message]:
        """Yield the messages of a robot's topic in the order in which they were sent.

        Raises:
            BagError: there are none, they have another type, or the bag is corrupted.
        """
        name = topic.of(robot)
        self._bag.require({name: topic.type})
        for message in self._bag.raw_messages([name]):
            try:
                decoded = conversions.from_cdr(message.cdr, topic.type)
            except Exception as error:  # the middleware's decoders have no common error
                reason = " ".join(str(error).split()) or type(error).__name__
                raise BagError(f"{self._bag.path}: a message on '{name}' can't be decoded: {reason}") from error
            yield decoded

    def any_messages(self, robot: str, topic: names.Topic) -> list[Message]:
        """List the messages of a robot's topic; none if it wasn't recorded.

        Raises:
            BagError: they have another type, or the bag is corrupted.
        """
        return list(self.messages(robot, topic)) if self.has(robot, topic) else []

    def own_parameters(self, robot: str) -> JsonObject:
        """Return the fine-tuner's parameters that are this follower's own: place and blackouts."""
        own: JsonObject = {"blackouts": self._own_blackouts[robot]} if robot in self._own_blackouts else {}
        number = names.follower_number(robot)
        if number <= len(self._slots):
            own["formation_distance_m"], own["formation_ahead_m"] = self._slots[number - 1]
        return own

    def parameters(self, kind: str, changes: JsonObject) -> Any:
        """Make a node's parameter object: as recorded, with some changed.

        Raises:
            ParameterError: a change has an unknown name or a wrong value.
        """
        cls = KINDS[kind].parameter_class()
        recorded = self._parameters.get(kind) or node_defaults(kind)
        present = specs(cls)
        known = {name: value for name, value in recorded.items() if name in present}
        self.notes += [f"{kind}.{name} is no parameter any more" for name in recorded if name not in known]
        return from_mapping(cls, {**known, **changes}, where=kind)


def host(kind: str, parameters: Any, robot: str, notes: list[str]) -> tuple[Component, list[tuple[str, Message]]]:
    """Make a component of a robot; return it with the list that what it sends (topic name, message) is put in."""
    component: Component = KINDS[kind].component_class()(parameters, Place(robot))
    sent: list[tuple[str, Message]] = []

    def say(level: int, text: str) -> None:
        if level > 0 and f"{robot}: {text}" not in notes:
            notes.append(f"{robot}: {text}")

    component.attach(lambda topic, message: sent.append((topic.name, message)), say)
    component.start()
    return component, sent


def handlers(component: Component) -> dict[str, Callable[[Message], None]]:
    """List a component's inputs by topic name."""
    return {entry.topic.name: entry.handler for entry in component.inputs()}


def equal(recorded: Sequence[Message], today: Sequence[Message]) -> bool:
    """Return whether two sequences of messages have the same values.

    Not their serialised form: what lies between its fields is not defined.
    """
    return list(recorded) == list(today)


def _changes(recorded: dict[str, str]) -> list[str]:
    """Describe which versions were others when the bag was recorded."""
    today = {**versions(), "commit": git_commit()}
    return [
        f"recorded with {name} {recorded[name]!s:.60}, now {today[name] or 'unknown'}"
        for name in recorded
        if recorded[name] and name in today and recorded[name] != today[name]
    ]
