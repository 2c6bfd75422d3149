"""Starts a run's nodes as processes of their own, watches them, and ends them in good order."""

from __future__ import annotations

import contextlib
import shlex
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import exit_codes
from robot_formation.bag.bag_path import PARTIAL_SUFFIX, PathReservation, check_free, recover_hint
from robot_formation.bag.errors import BagError
from robot_formation.bag.write_options import DEFAULT_OPTIONS, WriteOptions
from robot_formation.experiment.progress import Progress
from robot_formation.experiment.run_result import RunError, RunResult, joined_reasons
from robot_formation.experiment.scenario import Scenario
from robot_formation.experiment.stand_ins import LEADER_NODE, TIMEOUT_S, StandIns, how_to_start
from robot_formation.launching.child import Child
from robot_formation.launching.environment import joining, node_environment
from robot_formation.launching.fork_server import ForkServer, NodeNotStartedError
from robot_formation.launching.outcome import holds_still, recorder_failed, verdict
from robot_formation.launching.processes import Process, processes, viewer
from robot_formation.launching.view_announcement import Announcement
from robot_formation.launching.watchdog import STOPPED, Watchdog, stopped_text
from robot_formation.leader.paths import Teleop
from robot_formation.names import ONLOOKERS, RECORDER
from robot_formation.network.loopback import MANY_NODES
from robot_formation.network.ros_domain import DomainReservation
from robot_formation.network.shared_memory import clean_after_graph
from robot_formation.schedule.schedules import Spacing
from robot_formation.system.signal_handling import SignalCounter
from robot_formation.system.temporary_folder import RUN, temporary_folder

if TYPE_CHECKING:
    from robot_formation.nodes.progress.monitor import Monitor

_POLL_S = 0.05
_A_PERSONS_PATIENCE_S = 86400.0
"""A leader that a person drives may stand for a day."""
_REMIND_S = 15.0  # without a line of progress
_CAUGHT_UP_REPORTS, _CATCH_UP_S = 3, 10.0
_ORDERLY = (exit_codes.DONE, exit_codes.LOST)
# How long the nodes may take after each signal. A run must be over within ten seconds of a node's death.
_STOP_SIGNALS = ((signal.SIGINT, 3.0), (signal.SIGTERM, 1.0), (signal.SIGKILL, 1.0))
RECORDER_PATIENCE_S = (10.0, 5.0)
"""How long the recorder may take after SIGINT and after SIGTERM, s."""
_RECORDER_STOP_SIGNALS = (
    (signal.SIGINT, RECORDER_PATIENCE_S[0]),
    (signal.SIGTERM, RECORDER_PATIENCE_S[1]),
    (signal.SIGKILL, 1.0),
)


def _how_to_drive(domain: int) -> str:
    """Return the command with which a person drives the leader of this run."""
    return (
        f"drive the leader: {joining(domain)} ros2 run teleop_twist_keyboard "
        "teleop_twist_keyboard --ros-args -p stamped:=true -r cmd_vel:=/leader/cmd_vel"
    )


@dataclass
class Launcher:
    """Runs a scenario through the node graph.

    Args:
        scenario: what to run.
        bag: where the recorder writes; None records nothing.
        images: whether pictures are recorded too.
        say: takes the lines of progress.
        silence_s: wall seconds in which no robot does anything, after which the run is given up; longer in slow motion.
        options: how the bag's files are written.
        reservation: of the bag's path, if it has been taken already; it is released at the end.
        view_port: where a viewer serves; None for no viewer. The run goes on without a viewer that has died.
        stand_ins: nodes that somebody else starts, as `experiment.stand_ins` names them.
        stand_in_timeout_s: how long the run waits for them.
    """

    scenario: Scenario
    bag: Path | None
    images: bool = False
    say: Callable[[str], None] = lambda text: None
    silence_s: float = 90.0
    options: WriteOptions = DEFAULT_OPTIONS
    reservation: PathReservation | None = None
    view_port: int | None = None
    stand_ins: Sequence[str] = ()
    stand_in_timeout_s: float = TIMEOUT_S
    _children: list[Child] = field(default_factory=list, init=False)
    _signals: SignalCounter = field(default_factory=SignalCounter, init=False)
    _said_at: float = field(default=0.0, init=False)

    def run(self) -> RunResult:
        """Run to the end; whatever happens, no process, file or shared memory is left but the bag.

        Raises:
            BagError: if the bag's path is taken.
            RunError: if a node refuses its parameters, or something that it needs can't be imported.
        """
        with contextlib.ExitStack() as stack:
            if self.bag is not None:
                stack.enter_context(self.reservation or PathReservation(self.bag))
                check_free(self.bag)
            stack.enter_context(self._signals)
            folder = stack.enter_context(temporary_folder(RUN))
            domain = stack.enter_context(DomainReservation())
            # Those of every domain: also what a run left whose launcher was killed itself.
            stack.callback(clean_after_graph, domain)
            result = RunResult(exit_codes.NODE_DIED, self.bag)
            began = time.monotonic()
            try:
                environment = node_environment(domain, folder, self._nodes)
                if self.scenario.leader.path == Teleop.name:
                    self._tell(_how_to_drive(domain))
                result.exit_code, result.reason = self._drive(folder, environment, result)
            finally:
                ended = time.monotonic()
                result.running_s = ended - began - result.startup_s
                self._stop()
                result.stopping_s = time.monotonic() - ended
                result.usage = {child.name: child.usage for child in self._children if child.usage}
                result.warnings = [text for child in self._children for text in child.warnings()]
                self._settle(result)
        return result

    def _start(self, table: list[Process], folder: Path, server: ForkServer) -> None:
        for process in table:
            if self._signals.count:
                return
            self._children.append(Child(process, folder, server, lambda: bool(self._signals.count)))

    def _drive(self, folder: Path, environment: dict[str, str], result: RunResult) -> tuple[int, str]:
        """Start the nodes and follow the run until something ends it; return the exit code and why."""
        table = processes(self.scenario, self.bag, images=self.images, options=self.options, stand_ins=self.stand_ins)
        elsewhere = [process for process in table if process.stand_in]
        table = [process for process in table if not process.stand_in]
        announcement = None
        if self.view_port is not None:
            table.append(viewer(self.scenario, self.view_port))
            announcement = Announcement(self.view_port, self._tell)
        self._tell(f"starting {len(table)} nodes ...")
        began = time.monotonic()
        progress = self._progress(lambda: time.monotonic() - began)
        with contextlib.ExitStack() as stack:
            try:
                # Two processes import ROS at the same time: that of the nodes, and this one.
                log, few = folder / "fork_server.log", self._nodes < MANY_NODES
                with ForkServer(environment, log, farewell=few) as server:
                    from robot_formation.nodes.progress.monitor import Monitor  # needs the environment of the wheels

                    # The monitor joins first: the nodes then know of it before they send anything.
                    monitor = stack.enter_context(Monitor(environment, progress.topics, progress.listen))
                    self._start(table, folder, server)
            except NodeNotStartedError as error:
                interrupted = bool(self._signals.count)
                return (exit_codes.INTERRUPTED, "interrupted") if interrupted else (exit_codes.NODE_DIED, str(error))
            stand_ins = self._wait_for(elsewhere, folder, environment)
            code, reason = self._follow(monitor, progress, stand_ins, announcement, began, result)
            if code == exit_codes.DONE:
                stand_ins.run_done()
            return code, reason

    def _follow(
        self,
        monitor: Monitor,
        progress: Progress,
        stand_ins: StandIns,
        announcement: Announcement | None,
        began: float,
        result: RunResult,
    ) -> tuple[int, str]:
        """Follow the run until something ends it; return the exit code and why."""
        watchdog = Watchdog([child.name for child in self._needed], idle_s=self._patience_s())
        while True:
            monitor.spin(_POLL_S)
            if announcement is not None:
                announcement.look()
            if monitor.messages and not result.startup_s:
                result.startup_s = time.monotonic() - began
            if self._signals.count:
                return exit_codes.INTERRUPTED, "interrupted"
            ended = self._first_ended()
            if ended is not None:
                monitor.drain(_POLL_S, lambda: progress.complete)
                return self._ended_by(ended, monitor)
            reason = self._look(stand_ins, watchdog, monitor, progress)
            if self._tour_ended(progress, monitor, gone=bool(reason)):
                return exit_codes.DONE, ""
            if reason:
                self._tell(f"{reason}; ending the run ...")
                self._resume(monitor)
                return exit_codes.NODE_DIED, reason
            if not stand_ins.awaited and time.monotonic() - self._said_at > _REMIND_S:
                progress.remind()

    def _progress(self, elapsed: Callable[[], float]) -> Progress:
        delayed = self.scenario.setup.spacing is Spacing.DELAYED
        return Progress(self.scenario.slots, self.scenario.leader.timesteps, self._tell, elapsed, delayed=delayed)

    @property
    def _nodes(self) -> int:
        """How many nodes the run has, stand-ins included, without the recorder and viewers."""
        return len(list(self.scenario.hosts()))

    @property
    def _needed(self) -> list[Child]:
        """The nodes without which the run can't go on."""
        return [child for child in self._children if child.process.executable not in ONLOOKERS]

    def _first_ended(self) -> Child | None:
        """Return a node whose end ends the run: one that it needs, or one that can't be started as it was asked for."""
        for child in self._children:
            refused = child.poll() == exit_codes.BAD_INPUT
            if child.exit_code is not None and (refused or child in self._needed):
                return child
        return None

    def _ended_by(self, ended: Child, monitor: Monitor) -> tuple[int, str]:
        """Judge a node's end, which ends the run, by the others' states; then let those that are stopped go on."""
        try:
            return self._verdict(ended)
        finally:
            self._resume(monitor)

    def _wait_for(self, elsewhere: list[Process], folder: Path, environment: dict[str, str]) -> StandIns:
        """Tell how to start the nodes that somebody else starts, and begin to wait for them."""
        nodes = [process.name for process in elsewhere]
        if nodes:
            files = [f"--params-file {shlex.quote(str(process.write_parameters(folder)))}" for process in elsewhere]
            variables = joining(int(environment["ROS_DOMAIN_ID"]))
            for line in how_to_start(nodes, self.stand_in_timeout_s, variables, files):
                self._tell(line)
        return StandIns(nodes, self.stand_in_timeout_s, self._tell)

    def _tour_ended(self, progress: Progress, monitor: Monitor, *, gone: bool) -> bool:
        """Return whether the tour of a leader that was started elsewhere is over: no node of ours ends with it.

        Args:
            progress: follows the run.
            monitor: the messages, of which some may be on their way still.
            gone: whether something has gone, which may be that leader.
        """
        if LEADER_NODE not in self.stand_ins:
            return False
        if gone:
            monitor.drain(_POLL_S, lambda: progress.complete)
        return progress.complete

    def _look(self, stand_ins: StandIns, watchdog: Watchdog, monitor: Monitor, progress: Progress) -> str:
        """Return why the run can't go on, if it is time to look for that; the nodes stand while some are missing."""
        if stand_ins.due and (reason := stand_ins.look(monitor.nodes(), begun=progress.timestep_finished)):
            return reason
        if stand_ins.awaited or not watchdog.due:
            return ""
        states = {child.name: child.state for child in self._needed}
        reason = watchdog.look(states, monitor.reports, monitor.messages + monitor.pauses)
        if reason and self.stand_ins:
            reason += f"; started elsewhere: {', '.join(self.stand_ins)}"
        return reason

    def _resume(self, monitor: Monitor) -> None:
        """Let stopped nodes go on, so that they end in good order; a recorder first takes what was kept for it."""
        for child in [child for child in self._children if child.state == STOPPED]:
            child.signal(signal.SIGCONT)
            if child.process.executable == RECORDER:
                enough, end = monitor.reports[child.name] + _CAUGHT_UP_REPORTS, time.monotonic() + _CATCH_UP_S
                while monitor.reports[child.name] < enough and time.monotonic() < end and not self._signals.count:
                    monitor.spin(_POLL_S)

    def _patience_s(self) -> float:
        if self.scenario.leader.path == Teleop.name:
            return _A_PERSONS_PATIENCE_S
        factor = self.scenario.world.real_time_factor
        return self.silence_s / (min(factor, 1.0) or 1.0)

    def _tell(self, text: str) -> None:
        self._said_at = time.monotonic()
        self.say(text)

    def _verdict(self, ended: Child) -> tuple[int, str]:
        code = verdict(ended.process.executable, ended.exit_code or 0)
        if code == exit_codes.BAD_INPUT:
            raise RunError(f"{ended.name}: {ended.last_words()}")
        if code == exit_codes.DONE:
            # What such a node had still to do is missing.
            stopped = next((child for child in self._needed if child.state == STOPPED), None)
            return (exit_codes.NODE_DIED, stopped_text(stopped.name)) if stopped else (exit_codes.DONE, "")
        if code == exit_codes.LOST:
            return exit_codes.LOST, ended.last_words()
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
            interrupts = self._signals.count
            while any(child.poll() is None for child in children) and time.monotonic() < end:
                time.sleep(0.01)
                if self._signals.count > max(interrupts, 1):
                    break  # asked again: no more patience with this signal

    def _settle(self, result: RunResult) -> None:
        """Judge what came out after the run's own end: a recorder that failed, its bag, and other nodes' deaths."""
        if result.exit_code in _ORDERLY:
            for child in self._children:
                failed = recorder_failed(child.process.executable, child.exit_code)
                if child.exit_code in _ORDERLY and not failed:
                    continue
                how = "had to be killed, since it did not end when it was asked to" if child.forced else child.death
                if child not in self._needed:
                    result.warnings.append(f"node {child.name} {how}; the run does not need it")
                elif failed and child.forced and self.bag is not None and self.bag.exists():
                    # A bag's folder has its name only when it is whole. Fast DDS may deadlock when many nodes end at
                    # once (its issue 6502).
                    result.warnings.append(f"node {child.name} {how}; its bag is whole")
                elif failed:
                    result.exit_code, result.reason = exit_codes.NODE_DIED, f"node {child.name} {how}"
                else:
                    result.warnings.append(f"node {child.name} {how}, after the run's end")
            self._settle_lost(result)
        if self.bag is not None:
            self._settle_bag(self.bag, result)

    def _settle_lost(self, result: RunResult) -> None:
        """Judge what followers say that had lost their neighbours and held still until the run's end."""
        held = [child for child in self._children if holds_still(child.process.executable, child.exit_code)]
        if held and result.exit_code in _ORDERLY:
            result.exit_code = exit_codes.LOST
            result.reason = joined_reasons([child.last_words() for child in held], result.reason)

    def _settle_bag(self, bag: Path, result: RunResult) -> None:
        recorders = [child for child in self._children if child.process.executable == RECORDER]
        if any(child.exit_code == exit_codes.BAD_INPUT for child in recorders):
            result.bag = None  # it never opened a bag: what lies there is somebody else's
            return
        from robot_formation.launching.bag_rescue import missing_messages, rescue  # needs memory that nodes have now

        result.bag, problem = rescue(bag)
        if problem:
            result.warnings.append(problem)
        if result.bag is None:
            if result.exit_code in _ORDERLY:
                result.exit_code, result.reason = exit_codes.NODE_DIED, f"the recorder has left no bag at {bag}"
            return
        hint = recover_hint(bag.with_name(bag.name + PARTIAL_SUFFIX))
        result.reason = result.reason.replace(hint, f" (what was written is in {bag})")
        with contextlib.suppress(BagError):
            if missing := missing_messages(result.bag):
                result.warnings.append(missing)
