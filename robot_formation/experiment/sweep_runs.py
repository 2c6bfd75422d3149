"""The runs of a sweep, carried out on this machine's cores or on a Dask cluster; rows come as runs end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from functools import partial
from typing import Any, NamedTuple

from robot_formation import plugins
from robot_formation.batch.pool import run_parallel
from robot_formation.errors import FormationError
from robot_formation.experiment.sweep import Row, SweepError, Task, run_task
from robot_formation.extras import require
from robot_formation.plugins import PluginError

_GOES_ON = "the same command with the same --out goes on"


class Failure(NamedTuple):
    """A run that a class from outside the package has ended: which class, and the run with what was wrong."""

    subject: str
    text: str


class FailedRunsError(SweepError):
    """Runs that classes from outside the package have ended; all others of the sweep were done.

    Attributes:
        lines: one for each such class: its first failed run, and how many others failed.
        sweep: what the others have given; `rf.sweep` puts its `Sweep` there, None elsewhere.
    """

    sweep: Any = None

    def __init__(self, failures: Sequence[Failure]) -> None:
        """Take at least one failure."""
        texts: dict[str, list[str]] = {}
        for failure in failures:
            texts.setdefault(failure.subject, []).append(failure.text)
        self.lines = [_with_others(found[0], len(found) - 1) for found in texts.values()]
        super().__init__("; ".join(self.lines))


def _with_others(text: str, others: int) -> str:
    return f"{text} ({others} more of its runs failed)" if others else text


def carry_out(tasks: Iterable[Task], settings: Sequence[str], jobs: int, base: str = "") -> Iterator[Row]:
    """Run tasks on this machine's cores by joblib; yield rows in the order of the tasks, each as soon as it is there.

    For settings and base see `build`.

    Raises:
        FailedRunsError: when all others are done, if a class from outside the package failed in some.
        SweepError: if a run can't come to its end for another reason, or a worker process dies.
    """
    run = partial(run_task, base=base) if base else run_task
    try:
        yield from _rows(run_parallel(_attempt, ((run, task, settings) for task in tasks), jobs))
    except BrokenExecutor:
        raise SweepError(f"a worker process died (too little memory for --jobs {jobs}?); {_GOES_ON}") from None


def carry_out_by_dask(tasks: Iterable[Task], settings: Sequence[str], scheduler: str) -> Iterator[Row]:
    """Run tasks on a Dask cluster; yield rows as they come.

    Raises:
        FailedRunsError: when all others are done, if a class from outside the package failed in some.
        MissingExtraError: if Dask isn't installed.
        SweepError: if the scheduler doesn't answer or goes away, or a run can't be done there.
    """
    require("dask")
    from dask.distributed import Client, as_completed

    # What happens to the connection is told in a line here, not by a traceback in its log.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise SweepError(f"no Dask scheduler answers at {scheduler}: {reason}") from None
    with _told_when_gone(scheduler), client:
        futures = client.map(partial(_attempt, run_task, settings=settings), list(tasks), pure=False)
        yield from _rows(_result(future, scheduler) for future in as_completed(futures))


@contextlib.contextmanager
def _told_when_gone(scheduler: str) -> Iterator[None]:
    """Tell in a line that the connection to a Dask cluster was lost; what a worker raises is no exception here.

    Raises:
        SweepError: then.
    """
    try:
        yield
    except (OSError, asyncio.TimeoutError, CancelledError):
        raise SweepError(f"the Dask cluster at {scheduler} is gone; {_GOES_ON}") from None


def _result(future: Any, scheduler: str) -> Row | Failure:
    """Return what a Dask worker has found.

    Raises:
        SweepError: if it has found nothing.
    """
    if future.cancelled():
        raise SweepError(f"the Dask cluster at {scheduler} is gone; {_GOES_ON}")
    problem = future.exception()
    if isinstance(problem, FormationError):
        raise problem
    if problem is not None:
        raise SweepError(f"a Dask worker can't do the runs: {type(problem).__name__}: {problem}; {_GOES_ON}")
    result: Row | Failure = future.result()
    return result


def _attempt(run: Callable[[Task, Sequence[str]], Row], task: Task, settings: Sequence[str]) -> Row | Failure:
    """Carry out one run; a class from outside that fails doesn't stop the others."""
    try:
        return run(task, settings)
    except PluginError as error:
        return Failure(plugins.subject(error), str(error))


def _rows(results: Iterable[Row | Failure]) -> Iterator[Row]:
    """Yield the rows, and raise FailedRunsError at the end if some runs gave none."""
    failures = []
    for result in results:
        if isinstance(result, Failure):
            failures.append(result)
        else:
            yield result
    if failures:
        raise FailedRunsError(failures)
