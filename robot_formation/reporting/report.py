"""The report of runs and sweeps as a whole: which sections a page has, and where it is written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import robot_formation
from robot_formation.analysis.report import pictures_folder
from robot_formation.experiment.sweep import is_sweep
from robot_formation.reporting.citation import ARXIV, bibtex
from robot_formation.reporting.comparison_sections import anchor, comparison_sections
from robot_formation.reporting.markup import element, paragraph, section
from robot_formation.reporting.page import PageSpace, page
from robot_formation.reporting.run_sections import run_sections
from robot_formation.reporting.runs import ReportError, Run, load_runs
from robot_formation.reporting.sweep_sections import Sweep, load_sweep, sweep_sections
from robot_formation.system.temporary_folder import RUN, temporary_folder

_NO_ROOM = "Left out: with it the page would be larger than 5 MB. A report of this one alone has it."


def report_page(sources: Sequence[Path], namespace: str | None = None) -> str:
    """Return the page that reports runs and sweeps.

    Args:
        sources: bags of runs and folders of sweeps.
        namespace: where the formation lies in each bag, '/' for the root; None: wherever there is one.

    Raises:
        FormationError: one is given twice, missing or damaged, or is neither a run nor a sweep.
    """
    folders = [source for source in sources if is_sweep(source)]
    if len({folder.resolve() for folder in folders}) < len(folders):
        raise ReportError("a sweep's folder is given twice; give each once")
    sweeps = [load_sweep(number, folder) for number, folder in enumerate(folders, 1)]
    runs = load_runs([source for source in sources if source not in folders], namespace)
    with temporary_folder(RUN) as folder:
        sections = list(_sections(runs, sweeps, folder))
    lead = f"Report by robot_formation {robot_formation.__version__}. Along u is to the right, along v forward."
    return page(_title(runs, sweeps), lead, sections)


def default_path(sources: Sequence[Path]) -> Path:
    """Return where a report goes by default: into the sweep's folder, or beside the bag with the other pictures."""
    first, name = sources[0], "report.html" if len(sources) == 1 else "comparison.html"
    return (first if is_sweep(first) else pictures_folder(first)) / name


def _title(runs: Sequence[Run], sweeps: Sequence[Sweep]) -> str:
    if len(runs) == 1 and not sweeps:
        return f"{runs[0].analysis.scenario or 'Formation run'}: {runs[0].name}"
    if len(sweeps) == 1 and not runs:
        return f"Sweep: {sweeps[0].name}"
    counted = [f"{len(runs)} run{'s' if len(runs) > 1 else ''}"] if runs else []
    counted += [f"{len(sweeps)} sweep{'s' if len(sweeps) > 1 else ''}"] if sweeps else []
    return f"Report of {' and '.join(counted)}"


def _sections(runs: Sequence[Run], sweeps: Sequence[Sweep], folder: Path) -> Iterator[Element]:
    space, alone = PageSpace(), len(runs) + len(sweeps) == 1
    if len(runs) > 1:
        for each in comparison_sections(runs, folder):
            yield space.take(each, _NO_ROOM)
    for run in runs:
        if alone:
            for each in run_sections(run, folder, level=2):
                yield space.take(each, _NO_ROOM)
        else:
            inner = [space.take(each, _NO_ROOM) for each in run_sections(run, folder, level=3)]
            whole = section(f"{run.label.capitalize()}: {run.name}", *inner)
            whole.set("id", anchor(run))
            yield whole
    for sweep in sweeps:
        if alone:
            for each in sweep_sections(sweep, folder, level=2):
                yield space.take(each, _NO_ROOM)
        else:
            inner = [space.take(each, _NO_ROOM) for each in sweep_sections(sweep, folder, level=3)]
            yield section(f"Sweep: {sweep.name}", *inner)
    yield _cite()


def _cite() -> Element:
    link = element("a", "arXiv:2205.04052", href=ARXIV)
    return section(
        "Cite",
        paragraph("The project, and the paper whose method it implements (", link, "):"),
        element("pre", element("code", bibtex()), tabindex="0"),
    )
