"""Figures take names as they are, and leave an SVG's texts to a caller that has chosen."""

from pathlib import Path

import pytest
from matplotlib import rc_context

from robot_formation.analysis.plotting import new_figure, save_figure
from robot_formation.analysis.style import styled

NAME = r"a $\nonsense$ for 5$"


@styled
def draw(path: Path) -> Path:
    figure = new_figure(2.0, 1.0)
    figure.suptitle(NAME)
    return save_figure(figure, path)


def test_dollars_in_a_name_are_no_formula(tmp_path: Path) -> None:
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "mine"}):
        assert NAME in draw(tmp_path / "text.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize("suffix", ["svg", "pdf", "png"])
def test_the_same_figure_is_the_same_file(tmp_path: Path, suffix: str) -> None:
    one, other = (draw(tmp_path / f"{name}.{suffix}").read_bytes() for name in "ab")
    assert one == other
    assert b"<text" not in one  # outlines
