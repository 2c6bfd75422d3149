"""Garbage is collected seldom, and afterwards as before."""

import gc

from robot_formation.system.garbage import rare_collections


def test_collections_are_rare_meanwhile_and_as_before_afterwards() -> None:
    before = gc.get_threshold()
    with rare_collections():
        assert gc.get_threshold()[0] > before[0]
    assert gc.get_threshold() == before
