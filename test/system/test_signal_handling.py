"""Handlers of the signals that ask to end: an ignored SIGHUP stays ignored, everywhere; afterwards all is as before."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from signal import Signals
from typing import Any

import pytest

from robot_formation.system.signal_handling import ENDING, SignalCounter, give_back, take

NODE = """
import signal, sys
from robot_formation.nodes.host.signals import stop_on_signals, stopped
stop_on_signals()
signal.raise_signal(signal.SIGHUP)
hung_up = stopped()
signal.raise_signal(signal.SIGTERM)
print(hung_up, stopped())
"""


def ignore_hangup() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)


@pytest.fixture
def handlers() -> Iterator[dict[Signals, Any]]:
    before = {number: signal.getsignal(number) for number in ENDING}
    yield before
    for number, handler in before.items():
        signal.signal(number, handler)


def test_the_handlers_before_come_back(handlers: dict[Signals, Any]) -> None:
    came = []
    previous = take(lambda number, frame: came.append(number))
    for number in ENDING:
        signal.raise_signal(number)
    give_back(previous)
    assert came == list(ENDING)
    assert {number: signal.getsignal(number) for number in ENDING} == handlers


def test_an_ignored_hangup_stays_ignored(handlers: dict[Signals, Any]) -> None:
    ignore_hangup()
    came = []
    previous = take(lambda number, frame: came.append(number))
    signal.raise_signal(signal.SIGHUP)
    assert came == []
    give_back(previous)
    assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN


@pytest.mark.parametrize("ignored", [True, False])
def test_a_hangup_is_counted_unless_it_is_ignored(handlers: dict[Signals, Any], ignored: bool) -> None:
    if ignored:
        ignore_hangup()
    with SignalCounter() as signals:
        signal.raise_signal(signal.SIGHUP)
        assert signals.count == (0 if ignored else 1)
        assert signals.came() is not ignored


def test_signals_beyond_the_patience_interrupt(handlers: dict[Signals, Any]) -> None:
    with SignalCounter() as signals:
        for _ in range(3):
            signal.raise_signal(signal.SIGINT)
        assert signals.count == 3
    with SignalCounter(1) as signals:
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        assert signals.count == 2
    assert {number: signal.getsignal(number) for number in ENDING} == handlers


@pytest.mark.parametrize(("ignored", "printed"), [(True, "False True"), (False, "True True")])
def test_a_node_counts_a_hangup_unless_it_is_ignored(ignored: bool, printed: str) -> None:
    completed = subprocess.run(
        [sys.executable, "-c", NODE],
        preexec_fn=ignore_hangup if ignored else None,
        capture_output=True,
        text=True,
        check=True,
    )
    assert completed.stdout.strip() == printed
