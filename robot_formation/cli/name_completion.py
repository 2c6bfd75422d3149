"""What a shell offers as the values of options that take names: tracks, paths, surfaces, predictors, nodes."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from typing import Any


def offer_names(parser: argparse.ArgumentParser) -> None:
    """Tell argcomplete, for every verb, what the values of options are whose names can be listed."""
    for action in _actions(parser):
        for option in action.option_strings:
            kind = _KINDS.get(option.removesuffix("s") if option not in _KINDS else option)
            if kind is not None:
                action.completer = _completer(kind)  # type: ignore[attr-defined]  # argcomplete reads it


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the options of a parser and of its verbs."""
    for action in parser._actions:  # argparse has no public list of them
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                yield from _actions(verb)
        else:
            yield action


def _completer(kind: Callable[[], Iterable[str]]) -> Callable[..., list[str]]:
    def offered(prefix: str, **asked: Any) -> list[str]:
        from argcomplete.completers import FilesCompleter

        before, comma, _ = prefix.rpartition(",")  # options of several names take them with commas between them
        found = [f"{before}{comma}{name}" for name in kind()]
        return found + list(FilesCompleter()(prefix, **asked)) if kind is _scenarios else found

    return offered


def _tracks() -> Iterable[str]:
    from robot_formation.experiment.scenario import track_names

    return track_names()


def _scenarios() -> Iterable[str]:
    from robot_formation.experiment.scenario import formations

    return formations()


def _paths() -> Iterable[str]:
    from robot_formation.api.choices import leader_paths

    return leader_paths()


def _surfaces() -> Iterable[str]:
    from robot_formation.api.choices import surfaces

    return surfaces()


def _predictors() -> Iterable[str]:
    from robot_formation.api.choices import predictors

    return predictors()


def _schedules() -> Iterable[str]:
    from robot_formation.schedule.schedules import Schedule

    return [schedule.value for schedule in Schedule]


def _camera_modes() -> Iterable[str]:
    from robot_formation.world.parameters import CameraMode

    return [mode.value for mode in CameraMode]


def _nodes() -> Iterable[str]:
    from robot_formation.components.catalogue import KINDS

    return KINDS


_KINDS: dict[str, Callable[[], Iterable[str]]] = {
    "--track": _tracks,
    "--scenario": _scenarios,
    "--path": _paths,
    "--surface": _surfaces,
    "--predictor": _predictors,
    "--schedule": _schedules,
    "--camera": _camera_modes,
    "--without": _nodes,
}
"""By option; one of several names, like --tracks, has an s more."""
