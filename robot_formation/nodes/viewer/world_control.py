"""Pauses, steps and speed of the world, asked for by people who look at a run; none of them changes its results."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

AS_FAST = "as fast as possible"
SPEEDS = ("as it is set", "0.1", "0.25", "0.5", "1", "2", "4", AS_FAST)
_STEPS = 12
"""Physics steps of one step for people: a twentieth of a second by default."""
_ABSENT = "no world answers: a run on real robots can't be paused here"


class WorldControl:
    """Calls the world's services without waiting for them.

    Args:
        node: in whose namespace the world lies.

    Attributes:
        paused: whether the world was paused here.
        remark: what the world answered last, for people.
    """

    def __init__(self, node: Node) -> None:
        self._pause = node.create_client(SetBool, "world/pause")
        self._step = node.create_client(Trigger, "world/step")
        self._set = node.create_client(SetParameters, "world/set_parameters")
        self._left = 0
        self.paused = False
        self.remark = ""

    def toggle(self) -> None:
        """Pause, or go on."""
        if self._there(self._pause):
            self._left = 0
            wanted = not self.paused
            self._pause.call_async(SetBool.Request(data=wanted)).add_done_callback(
                lambda future: self._has_paused(future, wanted)
            )

    def step(self) -> None:
        """Let a little simulated time pass, and pause before if that is needed."""
        if not self.paused:
            self.toggle()
        if self._left == 0 and self._there(self._step):
            self._left = _STEPS
            self._next_step()

    def set_speed(self, text: str) -> None:
        """Let simulated time pass as fast as one of `SPEEDS` says."""
        if text != SPEEDS[0] and self._there(self._set):
            value = Parameter("real_time_factor", value=0.0 if text == AS_FAST else float(text))
            request = SetParameters.Request(parameters=[value.to_parameter_msg()])
            self._set.call_async(request).add_done_callback(self._has_set)

    def _there(self, client: Any) -> bool:
        there = bool(client.service_is_ready())
        self.remark = "" if there else _ABSENT
        return there

    def _next_step(self) -> None:
        self._step.call_async(Trigger.Request()).add_done_callback(self._has_stepped)

    def _has_paused(self, future: Future, wanted: bool) -> None:
        answer = future.result()
        if answer is not None and answer.success:
            self.paused = wanted
        self.remark = "the run is paused" if self.paused else ""

    def _has_stepped(self, future: Future) -> None:
        answer = future.result()
        if self._left == 0:
            return  # somebody has let the run go on meanwhile, and what this step said is history
        self._left = self._left - 1 if answer is not None and answer.success else 0
        self.remark = "" if answer is None else f"paused: {answer.message}"
        if self._left > 0:
            self._next_step()

    def _has_set(self, future: Future) -> None:
        answer = future.result()
        refused = [] if answer is None else [result.reason for result in answer.results if not result.successful]
        self.remark = refused[0] if refused else ""
