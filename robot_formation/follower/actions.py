"""What a fine-tuner answers to an event: actions, to be carried out in their order."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.follower.alignment_state import State
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion


@dataclass(frozen=True)
class SendMove:
    """Ask the drive for a displacement."""

    motion: Motion


@dataclass(frozen=True)
class RequestFrames:
    """Ask the camera for frames."""

    count: int


@dataclass(frozen=True)
class Report:
    """What the predictor learns from a timestep.

    Attributes:
        displacement: net, measured.
        residual: what is left by the camera's estimate; None: Target face not seen, or blind.
        commanded: what the displacement would have been had the prediction move gone as commanded; None: its end is
            unknown.
        caught_up_rad: standard deviation of what the displacement's turn makes good of earlier timesteps.
    """

    displacement: Motion
    residual: UncertainMotion | None
    commanded: Motion | None
    caught_up_rad: float = 0.0


@dataclass(frozen=True)
class Done:
    """Tick: the follower has finished this timestep."""

    timestep: int


@dataclass(frozen=True)
class Lost:
    """The neighbour is lost, and why: the follower stands from now on."""

    reason: str


@dataclass(frozen=True)
class Warn:
    """Something a person should know; the run goes on."""

    text: str


Action = SendMove | RequestFrames | Report | Done | State | Lost | Warn
