"""Starts a run's nodes as forks of one process that has imported what they need; each is then a process of its own.

Importing ROS, NumPy and the rest takes most of a node's start. Here one process imports it, once, and forks for each
node; memory is shared until it is written. The launcher asks to adopt orphans while the nodes start (Linux: child
subreaper), and each node is forked twice, so that it becomes a child of the launcher like any process that this
starts: the launcher waits for it, measures it and signals it. The server ends when all nodes are started.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import setproctitle

from robot_formation.experiment.run_result import RunError

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_PR_GET_CHILD_SUBREAPER = 37
_ADOPTION_S = 5.0
# What all nodes need; what only some need is imported before the first of these is forked.
_COMMON = ("robot_formation.nodes.executables", "robot_formation.nodes.host.component_node")
_OWN = {
    "world": "robot_formation.components.world",
    "overhead_tracker": "robot_formation.components.overhead_tracker",
    "drive": "robot_formation.components.drive",
    "block_detector": "robot_formation.components.block_detector",
    "predictor": "robot_formation.components.predictor",
    "fine_tuner": "robot_formation.components.fine_tuner",
    "leader": "robot_formation.components.leader",
    "recorder": "robot_formation.nodes.recorder.recorder_node",
}


class ForkServer:
    """The launcher's side: a server process while the nodes start; use it as a context manager.

    Args:
        environment: of the server and so of all nodes.
        log: file for what the server itself prints: errors.
    """

    def __init__(self, environment: Mapping[str, str], log: Path) -> None:
        self._environment, self._log = environment, log

    def __enter__(self) -> ForkServer:
        self._stack = contextlib.ExitStack()
        with self._stack:
            self._stack.enter_context(_adopting_orphans())
            with self._log.open("wb") as log:
                process = subprocess.Popen(
                    [sys.executable, "-m", "robot_formation.launching.fork_server", str(os.getpid())],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    env=dict(self._environment),
                    start_new_session=True,
                )
            assert process.stdin is not None
            assert process.stdout is not None
            self._process, self._requests, self._answers = process, process.stdin, process.stdout
            self._stack = self._stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        with contextlib.suppress(BrokenPipeError):
            self._requests.close()
        self._process.wait()
        self._answers.close()
        self._stack.close()

    def start(self, executable: str, arguments: Sequence[str], log: Path) -> int:
        """Start a node; return its process id.

        Args:
            executable: the name of the executable.
            arguments: its arguments, without the name.
            log: file for its output.

        Raises:
            RunError: if the server has ended, which it does when something can't be imported.
        """
        request = {"executable": executable, "arguments": list(arguments), "log": str(log)}
        answer = b""
        with contextlib.suppress(BrokenPipeError):
            self._requests.write(json.dumps(request).encode() + b"\n")
            self._requests.flush()
            answer = self._answers.readline()
        if not answer:
            last = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            raise RunError(f"the nodes can't be started: {last[-1] if last else 'the process that starts them ended'}")
        return int(answer)


@contextlib.contextmanager
def _adopting_orphans() -> Iterator[None]:
    """Become the parent of processes below this one whose own parent ends, for a while."""
    libc, before = ctypes.CDLL(None), ctypes.c_int()
    libc.prctl(_PR_GET_CHILD_SUBREAPER, ctypes.byref(before))
    libc.prctl(_PR_SET_CHILD_SUBREAPER, 1)
    try:
        yield
    finally:
        libc.prctl(_PR_SET_CHILD_SUBREAPER, before.value)


def die_with(parent: int) -> None:
    """Ask Linux to end this process in good order when its parent dies, however that happens; wait for that parent."""
    end = time.monotonic() + _ADOPTION_S
    while os.getppid() != parent:
        if time.monotonic() > end:
            raise SystemExit(f"process {parent} is gone")
        time.sleep(0.0005)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:  # it died meanwhile
        raise SystemExit(f"process {parent} is gone")


def serve(requests: BinaryIO, answers: BinaryIO, launcher: int) -> int:
    """Fork a node for each line of the requests, and answer with its process id, until they end.

    Returns in the server and in each node, with the exit code.
    """
    for name in _COMMON:
        importlib.import_module(name)
    for line in requests:
        request = json.loads(line)
        if request["executable"] in _OWN:
            importlib.import_module(_OWN[request["executable"]])
        gc.freeze()  # what is imported stays shared: collections in the nodes don't write to it
        middle = os.fork()
        if middle == 0:
            pid = os.fork()
            if pid:
                os.write(answers.fileno(), b"%d\n" % pid)
                os._exit(0)
            requests.close()
            answers.close()
            return _node(request["executable"], request["arguments"], request["log"], launcher)
        os.waitpid(middle, 0)
    return 0


def _node(executable: str, arguments: list[str], log: str, launcher: int) -> int:
    """Be a node from here on; return its exit code."""
    os.setsid()
    nothing, output = os.open(os.devnull, os.O_RDONLY), os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    for source, target in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(source, target)
    for source in (nothing, output):
        os.close(source)
    sys.argv = [executable, *arguments]
    setproctitle.setproctitle(" ".join(["robot_formation", *sys.argv]))
    die_with(launcher)
    from robot_formation.nodes import executables

    return int(getattr(executables, executable)())


if __name__ == "__main__":
    # Requests and answers get descriptors of their own: what a library prints goes to the log.
    pipes = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    die_with(int(sys.argv[1]))
    raise SystemExit(serve(*pipes, int(sys.argv[1])))
