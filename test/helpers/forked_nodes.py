"""Node processes for the tests' labs, forked by a server that has the imports behind it.

For all that a test sees from outside they are processes like those of `ros2 run`, children of pytest's process. What
happens before a node's first line (its imports, signals meanwhile) needs a real start instead: `Lab.open`.
"""

from __future__ import annotations

import atexit
import functools
import json
import os
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2  # noqa: F401  it changes LD_LIBRARY_PATH: before the server of the nodes takes that over

from graph_tools import STRICT
from node_server import MOST_BYTES
from robot_formation.launching.environment import node_environment
from robot_formation.launching.fork_server import adopting_orphans

SERVER = Path(__file__).with_name("node_server.py")
_OF_IMPORTS = ("PYTHON", "LD_LIBRARY_PATH")
"""Beginnings of the names of variables that are read while Python starts or imports: the server has them for all."""


class NodeServer:
    """The tests' side of the process that forks nodes.

    Args:
        environment: of the server; nodes get one of their own.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = environment
        self._requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, str(SERVER), str(os.getpid())],
                stdin=theirs.fileno(),
                env=dict(environment),
                start_new_session=True,
            )

    def fork(
        self, executable: str, arguments: Sequence[str], environment: Mapping[str, str], streams: Sequence[int]
    ) -> int:
        """Start a node, a child of this process; return its process id.

        Args:
            executable: the name of the executable.
            arguments: its arguments, without the name.
            environment: the node's.
            streams: descriptors of its standard input, output and error.
        """
        assert _of_imports(environment) == _of_imports(self._environment), "this needs a process started on its own"
        request = {"executable": executable, "arguments": list(arguments), "environment": dict(environment)}
        with adopting_orphans():
            socket.send_fds(self._requests, [json.dumps(request).encode()], streams)
            answers = [self._requests.recv(MOST_BYTES) for _ in range(2)]
        assert all(answers), "the process that forks nodes has ended"
        return int(json.loads(answers[0])["pid"])

    def close(self) -> None:
        """End the server; nodes that it has forked are not its own."""
        self._requests.close()
        self._process.wait()


def _of_imports(environment: Mapping[str, str]) -> dict[str, str]:
    return {name: text for name, text in environment.items() if name.startswith(_OF_IMPORTS)}


@functools.cache
def server() -> NodeServer:
    """The server of this process of pytest, started when the first node is wanted."""
    made = NodeServer({**node_environment(0, Path(os.devnull)), **STRICT})
    atexit.register(made.close)
    return made


class ForkedNode(subprocess.Popen[str]):
    """A node that the server forks; it is handled like a process that `subprocess` has started.

    Args:
        executable: the name of the executable.
        arguments: its arguments, without the name.
        environment: as from `node_environment`, with `STRICT`.
    """

    def __init__(self, executable: str, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        pipe = subprocess.PIPE
        super().__init__(
            [executable, *arguments], env=environment, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True
        )

    def _execute_child(self, args: list[str], *more: Any) -> None:
        """Fork where `subprocess` would: the one step of a start that it leaves to a method of its own."""
        environment, pipes = more[5], more[9:15]  # the ends of standard input, output and error: ours, the node's
        try:
            self.pid = server().fork(args[0], args[1:], environment, [pipes[0], pipes[3], pipes[5]])
            self._child_created = True
        finally:
            self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]
