"""Several paths one after another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from robot_formation.errors import shown
from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import Given, LeaderPath, PathKind
from robot_formation.parameters import ParameterError, parameter

MakePath = Callable[[str, Sequence[str], Given], LeaderPath]


@dataclass(frozen=True)
class Switch(PathKind):
    """Several paths one after another: each for some timesteps, the last one, without a number, to the end."""

    name: ClassVar[str] = "switch"
    parts: str = parameter(
        "straight:10 slalom:20 circle",
        "names of paths, each with its timesteps; their parameters are texts like slalom.period=20",
    )

    def sequence(self) -> list[tuple[str, int | None]]:
        """List the parts: names, and for how many timesteps; after the last with a number the first comes again.

        Raises:
            ParameterError: if the text isn't a list of parts.
        """
        found: list[tuple[str, int | None]] = []
        for text in self.parts.split():
            name, colon, count = text.partition(":")
            if colon and not (count.isdecimal() and 0 < int(count) <= 100000):
                raise ParameterError(f"path 'switch': {shown(text)} is no part; write NAME:TIMESTEPS, like straight:10")
            found.append((name, int(count) if colon else None))
        if not found or any(count is None for _, count in found[:-1]):
            raise ParameterError(
                "path 'switch': 'parts' is a list like 'straight:10 circle:20 slalom', where only the last may be "
                "without its timesteps"
            )
        return found

    def joined(self, given: Given, texts: Mapping[str, str], make: MakePath) -> LeaderPath:
        """Return the path, its parts made by `make`.

        Raises:
            ParameterError: if a part can't be made.
        """
        sequence = self.sequence()
        names = [name for name, _ in sequence]
        made: dict[str, LeaderPath] = {}
        for name in names:
            if name in (Switch.name, "teleop", "random_walk"):
                raise ParameterError(f"path 'switch': '{name}' can't be a part of it")
            own = [f"{key}={value}" for key, value in texts.items()]
            made[name] = made.get(name) or make(name, own, given)
        for name, count in sequence:
            most = made[name].timesteps
            if most is not None and count is not None and count > most:
                raise ParameterError(f"path 'switch': part '{name}:{count}' is longer than its {most} timesteps")
        return _Joined(tuple((made[name], count) for name, count in sequence))


@dataclass(frozen=True)
class _Joined:
    """Paths one after another; each part begins with its own timestep 1."""

    parts: Sequence[tuple[LeaderPath, int | None]]
    name: ClassVar[str] = Switch.name

    @property
    def timesteps(self) -> int | None:
        """See `LeaderPath`."""
        last, count = self.parts[-1]
        if count is not None or last.timesteps is None:
            return None
        return last.timesteps + sum(count or 0 for _, count in self.parts)

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        last = self.parts[-1][1]
        if last is not None:
            timestep = (timestep - 1) % sum(count or 0 for _, count in self.parts) + 1
        for path, count in self.parts:
            if count is None or timestep <= count:
                return path.motion(timestep)
            timestep -= count
        raise AssertionError("every timestep lies in a part")
