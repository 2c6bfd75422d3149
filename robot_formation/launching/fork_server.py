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
import inspect
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import setproctitle

from robot_formation import exit_codes
from robot_formation.errors import FormationError
from robot_formation.experiment.run_result import RunError
from robot_formation.launching.outcome import manner
from robot_formation.system.files import flush_open_files
from robot_formation.system.garbage import rare_collections

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_PR_GET_CHILD_SUBREAPER = 37
_ADOPTION_S = 5.0
_END_S = 5.0
_POLL_S = 0.1
_COMMON = ("robot_formation.nodes.executables", "robot_formation.nodes.host.component_node")
"""Modules that all nodes need; what only some need is imported before the first of these is forked."""
_RECORDER = "robot_formation.nodes.recorder.recorder_node"
ANSWER_S = 60.0
"""How long the server may take to import what a node needs and to fork it, s."""


class NodeNotStartedError(FormationError):
    """The process that starts nodes died, hangs, or was not waited for."""


class ForkServer:
    """The launcher's side: a server process while the nodes start; use it as a context manager.

    Args:
        environment: of the server and so of all nodes; an attribute too.
        log: file for what the server itself prints: errors.
        farewell: whether nodes leave the graph before they end, as `nodes.host.signals` says.
    """

    def __init__(self, environment: Mapping[str, str], log: Path, *, farewell: bool = True) -> None:
        self.environment, self._log, self._farewell = environment, log, farewell

    def __enter__(self) -> ForkServer:
        self._stack = contextlib.ExitStack()
        with self._stack:
            self._stack.enter_context(adopting_orphans())
            with self._log.open("wb") as log:
                process = subprocess.Popen(
                    [sys.executable, "-m", "robot_formation.launching.fork_server", str(os.getpid())],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    env=dict(self.environment),
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
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:  # it was stopped, or hangs in an import
            self._process.kill()
            self._process.wait()
        self._end_unclaimed()
        self._answers.close()
        self._stack.close()

    def _end_unclaimed(self) -> None:
        """Kill a node that was forked when nobody waited for it any more."""
        while select.select([self._answers], [], [], 0.0)[0] and (answer := self._answers.readline()):
            pid = int(answer)
            with contextlib.suppress(ProcessLookupError, ChildProcessError):
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)

    def start(
        self, executable: str, arguments: Sequence[str], log: Path, give_up: Callable[[], bool] = lambda: False
    ) -> int:
        """Start a node; return its process id.

        Args:
            executable: the name of the executable.
            arguments: its arguments, without the name.
            log: file for its output.
            give_up: asked while waiting for the server: whether to wait no longer.

        Raises:
            RunError: if something can't be imported.
            NodeNotStartedError: if the server died or doesn't answer, or `give_up` said so.
        """
        request = {
            "executable": executable,
            "arguments": list(arguments),
            "log": str(log),
            "farewell": self._farewell,
        }
        with contextlib.suppress(BrokenPipeError):
            self._requests.write(json.dumps(request).encode() + b"\n")
            self._requests.flush()
        answer = self._answer(give_up)
        if answer:
            return int(answer)
        code = self._process.wait()
        last = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        if code == 1 and last:  # Python's own exit code for an exception
            raise RunError(f"the nodes can't be started: {last[-1]}")
        raise NodeNotStartedError(f"{executable} was not started: the process that starts nodes {manner(code)}")

    def _answer(self, give_up: Callable[[], bool]) -> bytes:
        """Read the answer to a request; empty if the server has ended."""
        end = time.monotonic() + ANSWER_S
        while not select.select([self._answers], [], [], _POLL_S)[0]:
            if give_up():
                raise NodeNotStartedError("interrupted")
            if time.monotonic() > end:
                raise NodeNotStartedError(f"the process that starts nodes did not answer for {ANSWER_S:g} s")
        return self._answers.readline()


@contextlib.contextmanager
def adopting_orphans() -> Iterator[None]:
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
    with rare_collections():  # imports make objects, and hardly any garbage
        for name in _COMMON:
            importlib.import_module(name)
        from robot_formation.nodes.host.type_supports import load_type_supports

        load_type_supports()
    for line in requests:
        request = json.loads(line)
        _import_own(request["executable"])
        # rclpy looks up in whose file something is logged, in a list of all modules' files: made here, it is not made
        # in each node (26 ms).
        inspect.getmodule(serve.__code__)
        gc.freeze()  # what is imported stays shared: collections in the nodes don't write to it
        middle = os.fork()
        if middle == 0:
            pid = _forked_or_gone()
            if pid:
                os.write(answers.fileno(), b"%d\n" % pid)
                os._exit(0)
            requests.close()
            answers.close()
            return _node(launcher=launcher, **request)
        if os.waitpid(middle, 0)[1]:
            return exit_codes.NODE_DIED
    return exit_codes.DONE


def _import_own(executable: str) -> None:
    """Import what only this executable needs."""
    from robot_formation.components.catalogue import KINDS

    if executable in KINDS:
        KINDS[executable].component_class()
    else:
        importlib.import_module(_RECORDER)


def _forked_or_gone() -> int:
    """Fork; end this process at once where that fails, so that nobody takes it for the server."""
    try:
        return os.fork()
    except OSError as error:
        print(f"no process can be made: {error.strerror}", file=sys.stderr, flush=True)
        os._exit(exit_codes.NODE_DIED)


def _node(*, executable: str, arguments: list[str], log: str, farewell: bool, launcher: int) -> int:
    """Be a node from here on; return its exit code."""
    os.setsid()
    nothing, output = os.open(os.devnull, os.O_RDONLY), os.open(log, os.O_WRONLY | os.O_APPEND)
    for source, target in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(source, target)
    for source in (nothing, output):
        os.close(source)
    sys.argv = [executable, *arguments]
    setproctitle.setproctitle(" ".join(["robot_formation", *sys.argv]))
    die_with(launcher)
    from robot_formation.nodes import executables
    from robot_formation.nodes.host.signals import bounded_end, end_without_farewell

    if not farewell:
        end_without_farewell(launcher)
    code = int(getattr(executables, executable)())
    # This process leaves without Python's end, which would close them. A pipe that nobody reads takes no more.
    with bounded_end():
        flush_open_files()
    return code


if __name__ == "__main__":
    # Requests and answers get descriptors of their own: what a library prints goes to the log.
    pipes = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    die_with(int(sys.argv[1]))
    code = serve(*pipes, int(sys.argv[1]))
    # Taking the interpreter down would write to all that is shared, and free nothing that outlasts a process.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
