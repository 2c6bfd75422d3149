"""The whole state of a world as plain values: what must be kept so that it goes on to the last bit."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot_formation.world.bullet import pybullet


@dataclass(frozen=True)
class WorldState:
    """A saved world; plain values only, so it can be pickled and restored in another process.

    Attributes:
        setup: what the world was made of; a state fits worlds of the same setup only.
        start_ns: simulated time at step 0, nanoseconds.
        step_count: physics steps since the start.
        physics: Bullet's own state, contacts included.
        robots: wheels, encoders, motion and random streams by robot.
        sensors: random stream of each camera, and the exposure and white balance that it keeps, by robot.
        frames_owed: frames requested and not given yet, by robot.
        pending: commands of lockstep robots that wait for the others.
    """

    setup: str
    start_ns: int
    step_count: int
    physics: bytes
    robots: Mapping[str, Mapping[str, Any]]
    sensors: Mapping[str, Mapping[str, Any]]
    frames_owed: Mapping[str, int]
    pending: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]]


def save_physics(client: int) -> bytes:
    """Take Bullet's state of all bodies. Reading and resetting poses and velocities instead would lose last bits."""
    with tempfile.TemporaryDirectory(prefix="robot_formation_state_") as folder:
        file = Path(folder, "state.bullet")
        pybullet.saveBullet(str(file), physicsClientId=client)
        return file.read_bytes()


def restore_physics(client: int, state: bytes) -> None:
    """Put Bullet's state back into a client with the same bodies, made in the same order."""
    with tempfile.TemporaryDirectory(prefix="robot_formation_state_") as folder:
        file = Path(folder, "state.bullet")
        file.write_bytes(state)
        pybullet.restoreState(fileName=str(file), physicsClientId=client)
