"""A whole run in one process: the node graph's components on a queue, without a middleware.

The components, the messages and their order per topic are those of the node graph, so the run is the same to the last
bit.
"""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from robot_formation import conversions, exit_codes, plugins
from robot_formation.bag.bag_path import PathReservation, check_free
from robot_formation.bag.message_recorder import Recorder
from robot_formation.bag.write_options import DEFAULT_OPTIONS, WriteOptions
from robot_formation.components.base import Component, Handler, Place
from robot_formation.components.catalogue import NodeKind
from robot_formation.components.world import WorldComponent
from robot_formation.experiment.progress import Progress
from robot_formation.experiment.run_result import RunError, RunResult, joined_reasons
from robot_formation.experiment.scenario import Scenario
from robot_formation.names import IMAGE_TYPE, Message, Topic, absolute
from robot_formation.plugins import PluginError
from robot_formation.schedule.schedules import Spacing
from robot_formation.system.files import flush_open_files
from robot_formation.system.garbage import rare_collections
from robot_formation.world.events import RobotPose

P = TypeVar("P")


@dataclass
class _Hosted:
    component: Component
    namespace: str


@dataclass
class InProcessRun:
    """Builds the components of a scenario and runs them to the end.

    Args:
        scenario: what to run.
        recorder: where the messages go, if anywhere.
        images: whether pictures are recorded too.
        listen: called with absolute topic names and messages, before the components get them.
        heard: the absolute names of all topics that `listen` does something with; None: any. It is not called with
            others, and those that no component hears and that are costly to make are left out.
        on_pose: called with every pose of a robot as it is published, without a message made for it.
    """

    scenario: Scenario
    recorder: Recorder | None = None
    images: bool = False
    listen: Callable[[str, Message], None] | None = None
    heard: Collection[str] | None = None
    on_pose: Callable[[RobotPose], None] | None = None
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._queue: deque[tuple[str, Topic, Message]] = deque()
        self._handlers: dict[str, list[Handler]] = {}
        self._hosted = [self._host(kind, robot) for kind, robot in self.scenario.hosts()]
        for hosted in self._hosted:
            for entry in hosted.component.inputs():
                name = absolute(hosted.namespace, entry.topic.name)
                self._handlers.setdefault(name, []).append(entry.handler)
        (self._world,) = (h.component for h in self._hosted if isinstance(h.component, WorldComponent))

    @property
    def stamp_ns(self) -> int:
        """Simulated time, nanoseconds."""
        return self._world.stamp_ns

    def run(self) -> tuple[int, str]:
        """Run until a component ends; return the exit code (0 done, 3 lost or off the plate), and why unless done.

        Raises:
            RunError: if everybody waits for somebody, which no run should come to.
        """
        try:
            return self._run()
        finally:
            for hosted in self._hosted:
                hosted.component.close()

    def _run(self) -> tuple[int, str]:
        world = self._world
        world.on_pose = self.on_pose
        for hosted in self._hosted:
            hosted.component.start()
        while True:
            self._deliver()
            ended = [h.component for h in self._hosted if h.component.exit_code is not None]
            if ended:
                return self._ended(ended)
            if not world.busy:
                for hosted in self._hosted:
                    hosted.component.stalled()
                if self._queue or any(h.component.exit_code is not None for h in self._hosted):
                    continue
                last = f"; last warning: {self.warnings[-1]}" if self.warnings else ""
                raise RunError(f"the run stands still: everybody waits for somebody{last}")
            world.work()

    def _ended(self, ended: list[Component]) -> tuple[int, str]:
        """Judge the run by who has ended it, and by who has failed before and held still since then."""
        code, reason = max((component.exit_code or 0, component.exit_reason) for component in ended)
        held = [hosted.component for hosted in self._hosted if hosted.component.held_code]
        reasons = [component.held_reason for component in held]
        return max([code, *(c.held_code for c in held)]), joined_reasons(reasons, reason if code else "")

    def _host(self, kind: NodeKind[P], robot: str) -> _Hosted:
        component = kind.component_class()(self.scenario.of_robot(kind, robot), Place(robot))
        namespace = f"/{robot}" if robot else ""
        component.attach(partial(self._send, namespace), partial(self._say, f"{namespace}/{kind.name}"))
        component.wanted = partial(self._wanted, namespace)
        return _Hosted(component, namespace)

    def _wanted(self, namespace: str, topic: Topic) -> bool:
        """Whether anybody does something with what is sent on a topic."""
        name = absolute(namespace, topic.name)
        listened = self.listen is not None and (self.heard is None or name in self.heard)
        return self.recorder is not None or listened or name in self._handlers

    def _send(self, namespace: str, topic: Topic, message: Message) -> None:
        self._queue.append((absolute(namespace, topic.name), topic, message))

    def _say(self, node: str, level: int, text: str) -> None:
        if level > 0:
            self.warnings.append(f"{node}: {text}")

    def _deliver(self) -> None:
        queue = self._queue
        while queue:
            name, topic, message = queue.popleft()
            if self.recorder is not None and (self.images or topic.type != IMAGE_TYPE):
                self.recorder.record_as(name, topic, conversions.to_cdr(message))
            handlers = self._handlers.get(name, ())
            listen = self.listen if self.heard is None or name in self.heard else None
            if handlers or listen:
                message = conversions.as_message(message, topic.type)
            if listen is not None:
                listen(name, message)
            for handler in handlers:
                handler(message)


def progress_of(scenario: Scenario, say: Callable[[str], None]) -> Progress:
    """Make what listens to a run that begins now, and tells `say` a line per timestep."""
    began = time.monotonic()
    return Progress(
        scenario.slots,
        scenario.leader.timesteps,
        say,
        lambda: time.monotonic() - began,
        delayed=scenario.setup.spacing is Spacing.DELAYED,
    )


@rare_collections()  # not where many runs follow each other: what is left of a run is little in number, but 20 MB
def run_in_process(
    scenario: Scenario,
    bag: Path | None,
    metadata: dict[str, str],
    *,
    images: bool = False,
    options: WriteOptions = DEFAULT_OPTIONS,
    say: Callable[[str], None] = lambda text: None,
    reservation: PathReservation | None = None,
) -> RunResult:
    """Run a scenario, record it if a path is given, and tell its progress to `say`.

    A reservation of the bag's path may have been taken already; it is released at the end. If a class from outside the
    package fails after the start, the run ends as if its node had died: what was recorded until then stays.

    Raises:
        FormationError: if a component refuses its parameters, or the bag's path is taken or can't be written.
    """
    began = time.monotonic()
    progress = progress_of(scenario, say)
    # It may refuse its parameters: no bag is begun then.
    run = InProcessRun(scenario, None, images, progress.listen, frozenset(progress.topics))
    with contextlib.ExitStack() as stack:
        if bag is not None:
            stack.enter_context(reservation or PathReservation(bag))
            check_free(bag)
            run.recorder = Recorder(bag, metadata, options)
            stack.callback(run.recorder.close)
        try:
            code, reason = run.run()
        except (RunError, PluginError) as error:
            code, reason = exit_codes.NODE_DIED, str(error)
        except KeyboardInterrupt:
            code, reason = exit_codes.INTERRUPTED, "interrupted"
        if plugins.LOADED:  # what they have opened goes with the run, which refers to itself
            flush_open_files()
    return RunResult(code, bag, reason, run.warnings, running_s=time.monotonic() - began)
