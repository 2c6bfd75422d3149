"""Starts nodes in place of those that a run leaves out, by the words that the run prints."""

import contextlib
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence

_START = re.compile(r"start (\S+): (\S+=\S+(?: \S+=\S+)*) COMMAND (.*)")


def own_executable(node: str) -> list[str]:
    """The package's own executable of a node."""
    return [sys.executable, "-m", "robot_formation.nodes", node.rpartition("/")[2]]


class Starter:
    """Starts a process for each line that tells how to; hand it the run's lines.

    Args:
        command: of a node, by its full name.
        environment: what its shell has exported.
    """

    def __init__(
        self, command: Callable[[str], Sequence[str]] = own_executable, environment: Mapping[str, str] | None = None
    ) -> None:
        # Nothing of ROS is set in that shell but what the line says.
        exported = os.environ if environment is None else environment
        self._environment = {k: v for k, v in exported.items() if not k.startswith(("ROS_", "FASTRTPS_", "FASTDDS_"))}
        self._command = command
        self.started: dict[str, subprocess.Popen[bytes]] = {}
        self.said: list[str] = []

    def say(self, text: str) -> None:
        self.said.append(text)
        if match := _START.fullmatch(text.strip()):
            node, variables, arguments = match.groups()
            environment = {**self._environment, **dict(word.split("=", 1) for word in variables.split())}
            command = [*self._command(node), *shlex.split(arguments)]
            self.started[node] = subprocess.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, start_new_session=True
            )


@contextlib.contextmanager
def starter(
    command: Callable[[str], Sequence[str]] = own_executable, environment: Mapping[str, str] | None = None
) -> Iterator[Starter]:
    """A `Starter` of which no process is left at the end."""
    made = Starter(command, environment)
    try:
        yield made
    finally:
        for process in made.started.values():
            process.kill()
            process.wait()
