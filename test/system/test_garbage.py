"""Garbage is collected seldom, and afterwards as before."""

import gc

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
