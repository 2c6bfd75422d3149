"""docs/explanation/alignment.md against the code: the state machine's diagram and the verdicts."""

import re
from collections.abc import Callable
from functools import cache, partial

import numpy as np
import numpy.typing as npt
import pytest

from alignment_helpers import blocks_of, state_of
from repository import ROOT
from robot_formation.alignment.mode import Verdict
from robot_formation.follower.actions import Action, RequestFrames, SendMove
from robot_formation.follower.fine_tuning import FineTuner, FineTunerParameters, Phase
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import from_mapping

PAGE = (ROOT / "docs" / "explanation" / "alignment.md").read_text(encoding="utf-8")
IN_PLACE = state_of()


class Watched:
    """A fine-tuner whose transitions are noted as (from, to, event)."""

    def __init__(self, mode: str) -> None:
        look = {"frames": 1, "stable_frames": 1}
        values = {"mode": mode, "look": look, "blackouts": [2, 1]}
        self.tuner = FineTuner(from_mapping(FineTunerParameters, values, where="test"))
        self.seen: set[tuple[str, str, str]] = set()
        self.now_ns = 0

    def event(self, name: str, actions_of: Callable[[], list[Action]]) -> list[Action]:
        before = self.tuner.phase
        self.now_ns += 1
        actions = actions_of()
        after = self.tuner.phase
        if before is not after or (any(isinstance(action, RequestFrames) for action in actions) and name != "stalled"):
            self.seen.add((before.name, after.name, name))
        return actions

    def tick(self, timestep: int) -> None:
        name = "tick 0" if timestep == 0 else "tick"
        self.event(name, lambda: self.tuner.neighbour_done(timestep))

    def frame(self, state: npt.NDArray[np.float64] | None) -> list[Action]:
        blocks = [] if state is None else blocks_of(state)
        return self.event("frames", lambda: self.tuner.frame(blocks, self.now_ns))

    def moved(self, motion: Motion) -> list[Action]:
        return self.event("moved", lambda: self.tuner.moved(motion, self.now_ns))

    def stalled(self) -> None:
        self.event("stalled", self.tuner.stalled)

    def until_lost(self) -> None:
        """Show nothing, and carry out every move as asked."""
        for _ in range(100):
            for action in self.frame(None):
                if isinstance(action, SendMove):
                    self.moved(action.motion)
            if self.tuner.phase is Phase.LOST:
                return
        pytest.fail("never lost")

    def timestep(self, number: int) -> None:
        self.tick(number)
        self.moved(Motion(0.05))
        self.frame(IN_PLACE)
        if self.tuner.phase is Phase.MOVE:
            self.moved(Motion())
            self.frame(IN_PLACE)


@cache
def observed() -> set[tuple[str, str, str]]:
    seen = set()
    for mode in ("paper", "precise"):
        run = Watched(mode)
        run.tick(0)
        run.frame(None)
        run.frame(IN_PLACE)
        run.timestep(1)
        run.event("prediction", partial(run.tuner.prediction, Motion(0.05)))
        run.tick(2)
        run.moved(Motion(0.05))
        run.event("prediction", partial(run.tuner.prediction, Motion(0.05)))
        run.tick(3)
        run.moved(Motion(0.02))
        run.frame(state_of(x_m=0.03))
        run.moved(Motion(0.03))
        run.until_lost()
        dead = Watched(mode)
        dead.tick(0)
        for _ in range(4):
            dead.stalled()
        seen |= run.seen | dead.seen
    return seen


def test_the_diagram_shows_exactly_the_transitions_that_happen() -> None:
    diagram = re.search(r"stateDiagram-v2\n(.*?)```", PAGE, re.DOTALL)
    assert diagram
    drawn = set(re.findall(r"^  (\w+) --> (\w+): (.+)$", diagram[1], re.MULTILINE))
    assert drawn == observed()


def test_every_phase_is_in_the_diagram() -> None:
    assert {name for edge in observed() for name in edge[:2]} == set(Phase.__members__)


def test_the_table_has_every_verdict() -> None:
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)) == {verdict.value for verdict in Verdict}
