"""Buttons of people who look at a run: what they do while the world's answers are still on their way."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from robot_formation.nodes.viewer.world_control import _STEPS, WorldControl


class _World:
    """Stands for node and clients: takes calls, and answers them when the test says so."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, Any]] = []
        self._answers: list[Any] = []

    def create_client(self, kind: object, name: str) -> Any:
        return SimpleNamespace(service_is_ready=lambda: True, call_async=lambda request: self._call(name, request))

    def _call(self, name: str, request: Any) -> Any:
        self.calls.append((name.rpartition("/")[2], getattr(request, "data", None)))
        return SimpleNamespace(add_done_callback=self._answers.append)

    def answer(self, success: bool = True, message: str = "0.1 s") -> None:
        future = SimpleNamespace(result=lambda: SimpleNamespace(success=success, message=message))
        self._answers.pop(0)(future)

    @property
    def steps(self) -> int:
        return sum(name == "step" for name, _ in self.calls)


@pytest.fixture
def world() -> _World:
    return _World()


@pytest.fixture
def control(world: _World) -> WorldControl:
    control = WorldControl(world)  # type: ignore[arg-type]
    control.toggle()
    world.answer()
    assert control.paused
    return control


def test_a_click_makes_all_steps_one_after_another(world: _World, control: WorldControl) -> None:
    control.step()
    for made in range(1, _STEPS + 1):
        assert world.steps == made
        world.answer(message=f"{made} steps")
    assert (world.steps, control.remark) == (_STEPS, f"paused: {_STEPS} steps")


def test_a_refused_step_is_the_last_one(world: _World, control: WorldControl) -> None:
    control.step()
    world.answer(success=False, message="nothing is owed")
    assert (world.steps, control.remark) == (1, "paused: nothing is owed")
    control.step()
    assert world.steps == 2


def test_an_answer_after_going_on_says_nothing_and_blocks_no_later_step(world: _World, control: WorldControl) -> None:
    control.step()
    control.toggle()
    world.answer(message="late")
    world.answer()
    assert (control.paused, control.remark, world.steps) == (False, "", 1)
    control.toggle()
    world.answer()
    control.step()
    assert (control.paused, world.steps) == (True, 2)
