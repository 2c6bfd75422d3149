"""Starts a run's nodes as processes of their own, watches them, and ends them in good order."""

from __future__ import annotations

import contextlib
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robot_formation import exit_codes
from robot_formation.bag.errors import BagError
from robot_formation.bag.place import CUT_OFF_SUFFIX, PARTIAL_SUFFIX, PathReservation, check_free
from robot_formation.bag.recover import recover
from robot_formation.experiment.domain import DomainReservation
from robot_formation.experiment.progress import Progress
from robot_formation.experiment.run_result import RunError, RunResult
from robot_formation.experiment.scenario import Scenario
from robot_formation.experiment.shared_memory import clean_orphans, fast_dds_files, is_of_domain
from robot_formation.launching.child import Child
from robot_formation.launching.environment import node_environment
from robot_formation.launching.outcome import verdict
from robot_formation.launching.processes import RECORDER, processes

_POLL_S = 0.05
_CLEANING_ROUNDS = 6
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# How long the nodes may take after each signal. A run must be over within ten seconds of a node's death.
_STOP_SIGNALS = ((signal.SIGINT, 3.0), (signal.SIGTERM, 1.0), (signal.SIGKILL, 1.0))
RECORDER_PATIENCE_S = (10.0, 5.0)
"""How long the recorder may take after SIGINT and after SIGTERM, s."""
_RECORDER_STOP_SIGNALS = (
    (signal.SIGINT, RECORDER_PATIENCE_S[0]),
    (signal.SIGTERM, RECORDER_PATIENCE_S[1]),
    (signal.SIGKILL, 1.0),
)


def _clean_shared_memory(domain: int) -> None:
    """Remove what dead processes left, in rounds: the middleware lets go of the last files in its own time."""
    for _ in range(_CLEANING_ROUNDS):
        clean_orphans()
        if not any(is_of_domain(group, domain) for group in fast_dds_files()):
            return
        time.sleep(_POLL_S)


@dataclass
class Launcher:
    """Runs a scenario through the node graph.

    Args:
        scenario: what to run.
        bag: where the recorder writes; None records nothing.
        images: whether pictures are recorded too.
        say: takes the lines of progress.
        silence_s: wall seconds without any sign of life after which the run is given up; longer in slow motion.
        callback_delay_s: longest random delay before each callback of every node (tests).
        on_start: called once all processes run, with the ROS domain and the process ids by node name (tests).
    """

    scenario: Scenario
    bag: Path | None
    images: bool = False
    say: Callable[[str], None] = lambda text: None
    silence_s: float = 90.0
    callback_delay_s: float = 0.0
    on_start: Callable[[int, dict[str, int]], None] | None = None
    _children: list[Child] = field(default_factory=list, init=False)
    _interrupted: int = field(default=0, init=False)

    def run(self) -> RunResult:
        """Run to the end; whatever happens, no process, file or shared memory is left but the bag.

        Raises:
            BagError: if the bag's path is taken.
            RunError: if a node refuses its parameters.
        """
        with contextlib.ExitStack() as stack:
            if self.bag is not None:
                stack.enter_context(PathReservation(self.bag))
                check_free(self.bag)
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="robot_formation_")))
            domain = stack.enter_context(DomainReservation())
            stack.enter_context(self._signals())
            # Those of every domain: also what a run left whose launcher was killed itself.
            stack.callback(_clean_shared_memory, domain)
            result = RunResult(exit_codes.NODE_DIED, self.bag)
            began = time.monotonic()
            try:
                environment = node_environment(domain, folder)
                result.exit_code, result.reason = self._drive(folder, environment, result)
            finally:
                ended = time.monotonic()
                result.running_s = ended - began - result.startup_s
                self._stop()
                result.stopping_s = time.monotonic() - ended
                result.usage = {child.name: child.usage for child in self._children if child.usage}
                result.warnings = [text for child in self._children for text in child.warnings()]
                self._rescue_bag(result)
        return result

    def _start(self, folder: Path, environment: dict[str, str]) -> None:
        for process in processes(self.scenario, self.bag, images=self.images):
            if self.callback_delay_s and process.executable != RECORDER:
                delay = {"callback_delay_s": self.callback_delay_s}
                process = type(process)(process.executable, process.namespace, {**process.parameters, **delay})
            self._children.append(Child(process, folder, environment))
        if self.on_start is not None:
            self.on_start(int(environment["ROS_DOMAIN_ID"]), {child.name: child._popen.pid for child in self._children})

    def _drive(self, folder: Path, environment: dict[str, str], result: RunResult) -> tuple[int, str]:
        """Start the nodes and follow the run until something ends it; return the exit code and why."""
        from robot_formation.nodes.monitor import Monitor  # here, since it needs the environment of the wheels

        began = time.monotonic()
        setup, timesteps = self.scenario.setup, self.scenario.parameters("leader")["timesteps"]
        factor = self.scenario.parameters("world")["real_time_factor"]
        silence_s = self.silence_s / (min(factor, 1.0) or 1.0)
        progress = Progress(setup.followers, timesteps, self.say, lambda: time.monotonic() - began)
        # The monitor joins first: the nodes then know of it before they send anything.
        with Monitor(environment, progress.topics, progress.listen) as monitor:
            self._start(folder, environment)
            last, heard = time.monotonic(), 0
            while True:
                monitor.spin(_POLL_S)
                now = time.monotonic()
                if monitor.messages != heard:
                    last, heard = now, monitor.messages
                    result.startup_s = result.startup_s or now - began
                if self._interrupted:
                    return exit_codes.INTERRUPTED, "interrupted"
                ended = next((child for child in self._children if child.poll() is not None), None)
                if ended is not None:
                    monitor.drain(_POLL_S)
                    return self._verdict(ended)
                if now - last > silence_s:
                    return exit_codes.NODE_DIED, f"no node has shown a sign of life for {silence_s:.0f} s"

    def _verdict(self, ended: Child) -> tuple[int, str]:
        code = verdict(ended.process.executable, ended.exit_code or 0)
        if code == exit_codes.DONE:
            return code, ""
        if code == exit_codes.LOST:
            return code, ended.last_words()
        if code == exit_codes.BAD_INPUT:
            raise RunError(f"{ended.name}: {ended.last_words()}")
        return exit_codes.NODE_DIED, f"node {ended.name} {ended.death}"

    def _stop(self) -> None:
        """End all nodes, the recorder last, so that it gets everything that the others still send."""
        recorders = [child for child in self._children if child.process.executable == RECORDER]
        self._end([child for child in self._children if child not in recorders], _STOP_SIGNALS)
        self._end(recorders, _RECORDER_STOP_SIGNALS)

    def _end(self, children: list[Child], signals: tuple[tuple[signal.Signals, float], ...]) -> None:
        for number, patience_s in signals:
            end = time.monotonic() + patience_s
            for child in children:
                child.signal(number)
            interrupts = self._interrupted
            while any(child.poll() is None for child in children) and time.monotonic() < end:
                time.sleep(0.01)
                if self._interrupted > max(interrupts, 1):
                    break  # asked again: no more patience with this signal

    def _rescue_bag(self, result: RunResult) -> None:
        """Finish a bag that its recorder could not finish."""
        if self.bag is None or self.bag.exists():
            return
        if any(
            child.exit_code == exit_codes.BAD_INPUT for child in self._children if child.process.executable == RECORDER
        ):
            result.bag = None  # it never opened a bag: what lies there is somebody else's
            return
        partial = self.bag.with_name(self.bag.name + PARTIAL_SUFFIX)
        if not partial.exists():
            result.bag = None
            return
        cut_off = self.bag.with_name(self.bag.name + CUT_OFF_SUFFIX)
        partial.rename(cut_off)  # the whole bag is written under the partial one's name first
        try:
            report = recover(cut_off, self.bag)
        except BagError as error:
            result.warnings.append(str(error))
            result.bag = None
            return
        if report.damaged_chunks == 0:  # what else is missing had not been written: nothing more to get out of it
            shutil.rmtree(cut_off)

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        """Count SIGINT, SIGTERM and SIGHUP; each after the first shortens the wait for nodes to end in good order."""

        def handler(number: int, frame: Any) -> None:
            self._interrupted += 1

        before = {number: signal.signal(number, handler) for number in _SIGNALS}
        try:
            yield
        finally:
            for number, previous in before.items():
                signal.signal(number, previous)
