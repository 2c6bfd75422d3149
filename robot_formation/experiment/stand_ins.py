"""Nodes of a run that somebody else starts, in place of the package's own: which they are, and whether they are there.

A stand-in is known by its full name in the ROS graph; what kind of program it is doesn't matter.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Sequence

from robot_formation import names
from robot_formation.errors import FormationError, shown
from robot_formation.experiment.scenario import Scenario
from robot_formation.parameters import suggestion

TIMEOUT_S = 300.0
"""How long a run waits for its stand-ins by default: a person has to start them."""
LONGEST_S = 86400.0
"""The longest time that it can be told to wait."""
LEADER_NODE = names.under(names.LEADER, names.LEADER)
"""The leader's node, whose end is the run's."""
WORLD_NODE = "/world"
"""The node that stands in for robots and ground."""
_EVERY_S = 0.5
_UNSEEN_S = 20.0
"""How long a stand-in may remain unseen once the run has begun, for which it must have been there. It is seen within
some 3 s; the middleware lists one that has died for 20 s."""


def stand_ins_of(scenario: Scenario, asked: Iterable[str], source: str) -> tuple[str, ...]:
    """Return the nodes that are left out, by their names in the formation's namespace, in the order of start.

    Args:
        scenario: what is run.
        asked: names like 'block_detector', which means that of every robot, or 'follower_2/block_detector'.
        source: the option, for messages.

    Raises:
        FormationError: there is no such node; with the nearest name.
    """
    nodes = {names.under(robot, kind.name): kind.name for kind, robot in scenario.hosts()}
    left_out: set[str] = set()
    for text in (part for entry in asked for part in entry.split(",")):
        name = text.strip("/")
        found = {node for node, kind in nodes.items() if name in (node, kind)}
        if not found:
            known = dict.fromkeys([*nodes.values(), *nodes])
            raise FormationError(f"{source}: this run has no node {shown(name)} to leave out{suggestion(name, known)}")
        left_out |= found
    return tuple(node for node in nodes if node in left_out)


def how_to_start(nodes: Sequence[str], timeout_s: float, variables: str = "", options: Sequence[str] = ()) -> list[str]:
    """Return lines that tell how to start stand-ins: one for all, and each one's command.

    Args:
        nodes: their full names.
        timeout_s: how long they are waited for.
        variables: what the shell has to set for them.
        options: further arguments of ROS, for each node or for none.
    """
    lines = [
        f"waiting for nodes that you start, for at most {timeout_s:g} s; "
        "COMMAND is what starts yours: ros2 run PACKAGE EXECUTABLE, python -m MODULE, ..."
    ]
    for node, option in zip(nodes, options or [""] * len(nodes), strict=True):
        namespace, _, name = node.rpartition("/")
        words = [variables, "COMMAND --ros-args", f"-r __ns:={namespace or '/'} -r __node:={name}", option]
        lines.append(f"start {node}: {' '.join(filter(None, words))}")
    return lines


class StandIns:
    """Waits for nodes to appear in the graph; from then on notices when one of them goes.

    Args:
        nodes: their full names.
        timeout_s: how long they may take to appear.
        say: takes a line for each that has appeared.
        clock: wall seconds from any origin.
    """

    def __init__(
        self,
        nodes: Iterable[str],
        timeout_s: float,
        say: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._missing = list(nodes)
        self._present: list[str] = []
        self._timeout_s = timeout_s
        self._say = say
        self._clock = clock
        self._began = clock()
        self._looked_at = -_EVERY_S + self._began
        self._run_began: float | None = None

    @property
    def awaited(self) -> bool:
        """Whether some have not appeared yet."""
        return bool(self._missing)

    @property
    def due(self) -> bool:
        """Whether it is time to look into the graph."""
        return bool(self._missing or self._present) and self._clock() - self._looked_at >= _EVERY_S

    def run_done(self) -> None:
        """Register the end of a run that came to its last timestep: those not seen yet took part all the same.

        The launcher's own view of the graph may be up to 3 s old, and a short run is over sooner.
        """
        for node in self._missing:
            self._say(f"{node} was there")
        self._missing = []

    def look(self, graph: Collection[str], *, begun: bool) -> str:
        """Update with the nodes of the graph; return why the run can't go on, or an empty text.

        Args:
            graph: full names of the nodes that are there.
            begun: whether a follower has finished a timestep.
        """
        self._looked_at = self._clock()
        if begun and self._run_began is None:
            self._run_began = self._looked_at
        for node in [node for node in self._missing if node in graph]:
            self._missing.remove(node)
            self._present.append(node)
            more = f"; still waiting for {', '.join(self._missing)}" if self._missing else ""
            self._say(f"{node} is there{more}")
        gone = [node for node in self._present if node not in graph]
        if gone:
            return f"node {gone[0]}, started elsewhere, is gone"
        if self._missing and self._run_began is not None and self._looked_at - self._run_began > _UNSEEN_S:
            return f"node {self._missing[0]}, started elsewhere, was never seen, although the run has begun"
        if self._missing and self._looked_at - self._began > self._timeout_s:
            return f"no node {' and no node '.join(self._missing)} appeared within {self._timeout_s:g} s"
        return ""
