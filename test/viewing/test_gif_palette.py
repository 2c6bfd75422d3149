"""The colours of a GIF."""

import numpy as np

from robot_formation.viewing.gif_palette import Palette

RANDOM = np.random.default_rng(1)


def test_common_colours_stay_as_they_are_and_others_become_the_nearest() -> None:
    picture = RANDOM.integers(0, 256, (80, 90, 3), dtype=np.uint8)
    picture[:40] = (255, 255, 255)
    picture[40:50] = (235, 235, 235)
    palette = Palette(picture)
    drawn = np.asarray(palette.image(picture).convert("RGB"))
    assert np.array_equal(drawn[:50], picture[:50])
    assert len(palette.colours) <= 256
    for row, column in ((60, 3), (70, 50), (79, 89)):
        distances = np.abs(((palette.colours - picture[row, column].astype(int)) ** 2).sum(axis=1))
        assert ((drawn[row, column].astype(int) - picture[row, column]) ** 2).sum() == distances.min()


def test_colours_that_come_later_are_found_too() -> None:
    palette = Palette(np.zeros((4, 4, 3), np.uint8))
    assert np.all(np.asarray(palette.image(np.full((2, 2, 3), 200, np.uint8)).convert("RGB")) == 0)
