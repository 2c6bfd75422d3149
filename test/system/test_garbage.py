"""Garbage is collected seldom, and afterwards as before."""

import gc
import subprocess
import sys

import pytest

from robot_formation.system.garbage import rare_collections


def test_collections_are_rare_meanwhile_and_as_before_afterwards() -> None:
    before = gc.get_threshold()
    with rare_collections():
        assert gc.get_threshold()[0] > before[0]
    assert gc.get_threshold() == before


@pytest.mark.parametrize("chosen", [0, 10**6])
def test_who_collects_still_more_seldom_is_left_alone(chosen: int) -> None:
    before = gc.get_threshold()
    gc.set_threshold(chosen, *before[1:])
    try:
        with rare_collections():
            assert gc.get_threshold()[0] == chosen
    finally:
        gc.set_threshold(*before)


@pytest.mark.parametrize(
    ("call", "frozen"),
    [
        ("sys.argv[1:] = words; main()", True),
        ("main(words)", False),
    ],
)
def test_what_is_imported_is_left_out_of_collections_in_the_commands_own_process_only(call: str, frozen: bool) -> None:
    code = (
        "import gc, sys; from robot_formation.cli.main import main; "
        f"words = ['run', '--track', 'nowhere']; {call}; print(gc.get_freeze_count() > 10000)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    assert "no track 'nowhere'" in done.stderr
    assert done.stdout.strip() == str(frozen)
