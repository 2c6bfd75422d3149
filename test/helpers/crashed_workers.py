"""A pytest plugin: when a process of pytest-xdist dies within a test, that test has failed and all others are run.

With `--dist loadgroup` pytest-xdist 3.8 hands out what the dead process had done already as empty units, starts the
fatal test again, and waits for ever for one or the other (its issues 1189, 1323, 1327, 1371).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler import LoadGroupScheduling
    from xdist.workermanage import WorkerController


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadGroupScheduling | None:
    """Schedule groups in a way that outlives processes."""
    return _scheduling(config, log) if config.getoption("dist") == "loadgroup" else None


_DIED: pytest.StashKey[list[object]] = pytest.StashKey()
_DIED_BETWEEN_TESTS: pytest.StashKey[bool] = pytest.StashKey()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: WorkerController, error: object | None) -> None:
    """Note the processes that didn't end by themselves."""
    if error is not None:
        node.config.stash.setdefault(_DIED, []).append(node)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail the run if a process died, but not in a test, which would have failed by its name."""
    if session.exitstatus == pytest.ExitCode.OK and session.config.stash.get(_DIED_BETWEEN_TESTS, False):
        session.exitstatus = pytest.ExitCode.INTERNAL_ERROR


def _scheduling(config: pytest.Config, log: Producer) -> LoadGroupScheduling:
    from xdist.scheduler import LoadGroupScheduling

    class Scheduling(LoadGroupScheduling):  # type: ignore[misc]  # it has no types
        def remove_node(self, node: WorkerController) -> str | None:
            """Take the work that a process has left; return the test in which it died, if it died in one."""
            units = self.assigned_work.pop(node)
            fatal = next((test for unit in units.values() for test, done in unit.items() if not done), None)
            if fatal is None and node in self.config.stash.get(_DIED, []):
                self.config.stash[_DIED_BETWEEN_TESTS] = True
            for scope, unit in units.items():
                left = {test: False for test, done in unit.items() if not done and test != fatal}
                if left:
                    self.workqueue[scope] = left
            # The others take from the queue as they finish; what they leave is for the process's successor.
            return fatal

        def mark_test_pending(self, item: str) -> None:
            """Put a fatal test in the queue again: pytest-rerunfailures asks for it."""
            scope = self._split_scope(item)
            self.workqueue[scope] = {item: False, **self.workqueue.get(scope, {})}

        def _assign_work_unit(self, node: WorkerController) -> None:
            """Hand out units until there are two tests: a process begins one when it knows the next, or that none is.

            A new process is asked for before it has collected its tests, if another one has done so.
            """
            while self.workqueue and node in self.registered_collections:
                super()._assign_work_unit(node)
                if self._pending_of(self.assigned_work[node]) > 1:
                    return

    return Scheduling(config, log)
