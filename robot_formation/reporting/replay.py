"""The three-dimensional replay of a run as part of a page: the viewer's own page in a frame."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.reader import read_bag
from robot_formation.errors import FormationError
from robot_formation.reporting.markup import element, paragraph, section
from robot_formation.reporting.runs import Run


def replay_section(run: Run, level: int) -> Element:
    """Return a section with the replay, or with the reason why there is none.

    Args:
        run: the run; its bag is read once more.
        level: of the heading.
    """
    notes: list[str] = []
    try:
        text = _replay_page(run, notes)
    except FormationError as error:  # no true poses in the bag, or viser is not installed
        return section("Replay", paragraph(f"There is none: {error}.", class_="quiet"), level=level)
    frame = element("iframe", srcdoc=text, title=f"Replay of {run.name} in three dimensions", loading="lazy")
    return section("Replay", frame, *(paragraph(note, class_="quiet") for note in notes), level=level)


def _replay_page(run: Run, notes: list[str]) -> str:
    """Return the viewer's page of a run.

    Args:
        run: the run.
        notes: takes what the viewer could not show.

    Raises:
        FormationError: viser is not installed, or the bag doesn't hold what a view needs.
    """
    from robot_formation.viewing.browser import check_viewer
    from robot_formation.viewing.run_moments import RunMoments
    from robot_formation.viewing.view_page import make_page

    check_viewer(0)
    with read_bag(run.bag) as opened:
        bag = FormationBag(opened, run.namespace)
        return make_page(bag, RunMoments(bag), notes.append)
