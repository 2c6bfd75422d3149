"""Tasks on this machine's cores by joblib; an interrupt ends them without a word of the workers or of the pool."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from robot_formation.system.threads import one_thread
from robot_formation.system.variables import set_for_a_while

T = TypeVar("T")
_MANAGER = "ExecutorManagerThread"
_ENDS_S = 5.0


def run_parallel(function: Callable[..., T], arguments: Iterable[tuple[object, ...]], jobs: int) -> Iterator[T]:
    """Call a function with each tuple of arguments in worker processes; yield results in the same order.

    Raises:
        BrokenExecutor: a worker process died.
        Exception: what the function raises.
    """
    from joblib import Parallel, delayed

    # One task in a worker at a time; a few wait, so that no worker idles.
    pool = Parallel(n_jobs=jobs, return_as="generator", batch_size=1, pre_dispatch="3*n_jobs")
    with _quiet_manager():
        with _without_interrupts(), set_for_a_while(_worker_environment()):  # the workers start here, and inherit both
            results = pool(delayed(_uninterrupted)(jobs > 1, function, entry) for entry in arguments)
        yield from results


def _uninterrupted(in_worker: bool, function: Callable[..., T], arguments: tuple[object, ...]) -> T:
    """Call a function; in a worker that the pool has started later, interrupts are for its parent too."""
    if in_worker:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return function(*arguments)


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Let processes be started that don't hear SIGINT. One that comes meanwhile is taken at the end."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _worker_environment() -> dict[str, str]:
    """Return variables for processes that work in one thread each, and don't print warnings of loky's resource tracker.

    The tracker is a process of its own, which after an interrupt may want to remove what the pool has removed already.
    """
    warnings = ",".join(filter(None, (os.environ.get("PYTHONWARNINGS"), "ignore:resource_tracker:UserWarning")))
    return {**one_thread(os.environ), "PYTHONWARNINGS": warnings}


@contextlib.contextmanager
def _quiet_manager() -> Iterator[None]:
    """Silence the thread that manages loky's workers where it stumbles over tasks that an interrupt has cancelled.

    It looks up a task that was taken back when the pool was shut down, after it has ended the workers.
    """
    before = threading.excepthook

    def hook(problem: threading.ExceptHookArgs, /) -> None:
        manager = problem.thread is not None and problem.thread.name == _MANAGER
        if not (manager and issubclass(problem.exc_type, KeyError)):
            before(problem)

    threading.excepthook = hook
    try:
        yield
    except BaseException:  # the pool was shut down: the thread ends, in whatever way
        for thread in threading.enumerate():
            if thread.name == _MANAGER:
                thread.join(_ENDS_S)
        raise
    finally:
        threading.excepthook = before
