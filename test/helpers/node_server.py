"""Forks nodes for the tests from one process that has imported what they need: the imports cost a second each.

A script: `forked_nodes` starts it, once for each process of pytest, and it ends with that process. A request is one
message on its standard input, a socket: a mapping, and the node's three streams as descriptors. Two answers follow: the
node's process id, and an empty mapping once the node is an orphan, which pytest's process has asked to adopt.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import socket
import sys
from collections.abc import Mapping
from typing import Any

import setproctitle

from robot_formation.launching.fork_server import die_with

MOST_BYTES = 1 << 17
"""What a message may have."""
COMMAND_LINE = "formation"
"""The name by which the command line is asked for."""
_COMMON = ("robot_formation.nodes.executables", "robot_formation.nodes.host.component_node")
_OF_VERBS = ("robot_formation.cli.main", "robot_formation.nodes.host.session")


def serve(requests: socket.socket, tests: int) -> int:
    """Fork a node for each request until they end.

    Args:
        requests: the socket.
        tests: the process id of pytest, with which the nodes end.

    Returns:
        The exit code, in the server and in each node.
    """
    for name in _COMMON:
        importlib.import_module(name)
    while True:
        text, streams, _, _ = socket.recv_fds(requests, MOST_BYTES, 3)
        if not text:
            return 0
        request = json.loads(text)
        _import_own(request["executable"])
        gc.freeze()  # what is imported stays shared
        middle = os.fork()
        if middle == 0:
            pid = os.fork()
            if pid:
                requests.send(json.dumps({"pid": pid}).encode())
                os._exit(0)
            requests.close()
            return _node(request, streams, tests)
        os.waitpid(middle, 0)
        for stream in streams:
            os.close(stream)
        requests.send(b"{}")


def _import_own(executable: str) -> None:
    from robot_formation.components.catalogue import KINDS

    if executable == COMMAND_LINE:
        for name in (*_OF_VERBS, *(f"robot_formation.nodes.{node}.{node}_node" for node in ("recorder", "player"))):
            importlib.import_module(name)
    elif executable in KINDS:
        KINDS[executable].component_class()
    else:
        importlib.import_module(f"robot_formation.nodes.{executable}.{executable}_node")


def _node(request: Mapping[str, Any], streams: list[int], tests: int) -> int:
    """Be a node from here on, in a session of its own as in a terminal; return its exit code."""
    os.setsid()
    for target, stream in enumerate(streams):
        os.dup2(stream, target)
        os.close(stream)
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv = [request["executable"], *request["arguments"]]
    setproctitle.setproctitle(" ".join(["robot_formation", *sys.argv]))
    die_with(tests)
    if sys.argv[0] == COMMAND_LINE:
        from robot_formation.cli.__main__ import main

        return main()
    from robot_formation.nodes import executables

    return int(getattr(executables, sys.argv[0])())


if __name__ == "__main__":
    # The requests get a descriptor of their own: 0 to 2 are the nodes'.
    with socket.socket(fileno=os.dup(0)) as channel:
        die_with(int(sys.argv[1]))
        raise SystemExit(serve(channel, int(sys.argv[1])))
