"""The runs that are compared or reported: read from their bags, analysed, and numbered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from robot_formation.analysis.conditions import run_facts
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import FollowerAnalysis, RunAnalysis, analyse
from robot_formation.analysis.run_record import RunRecord
from robot_formation.bag.folder import METADATA_FILE, bag_name
from robot_formation.errors import FormationError
from robot_formation.json_values import JsonObject


class ReportError(FormationError):
    """Runs can't be compared or reported as asked for."""


@dataclass(frozen=True)
class Run:
    """A run that is compared with others.

    Attributes:
        number: among them, from 1 on.
        bag: as it was given.
        record: what is known of it.
        analysis: its quantities.
        namespace: where the formation lies in the bag, as it was given.
    """

    number: int
    bag: Path
    record: RunRecord
    analysis: RunAnalysis
    namespace: str | None = None

    @property
    def label(self) -> str:
        """Its number in words."""
        return f"run {self.number}"

    @property
    def name(self) -> str:
        """The bag's name."""
        return bag_name(self.bag)

    @cached_property
    def facts(self) -> JsonObject:
        """Which run it was, as the command line's JSON has it."""
        return run_facts(self.record.details)

    def follower(self, name: str) -> FollowerAnalysis | None:
        """Return a follower's analysis, if the run has one of this name."""
        return next((follower for follower in self.analysis.followers if follower.name == name), None)

    def to_json(self) -> JsonObject:
        """Return what `formation analyze --json` prints of it, without pictures."""
        files: JsonObject = {"bag": str(self.bag), "pictures": [], "reason": None}
        return {**self.analysis.to_json(), **self.facts, **files}


def load_runs(bags: Sequence[Path], namespace: str | None = None) -> list[Run]:
    """Read and analyse runs.

    Args:
        bags: their bags, each a folder, a file or what a killed recorder left.
        namespace: where the formation lies in each, '/' for the root; None: wherever there is one.

    Raises:
        ReportError: a bag is given twice.
        FormationError: a bag is missing, damaged or holds no run.
    """
    places: dict[Path, Path] = {}
    for bag in bags:
        place = _place(bag)
        if place in places:
            raise ReportError(f"{bag} is given twice, the first time as {places[place]}; give each bag once")
        places[place] = bag
    runs = []
    for number, bag in enumerate(bags, 1):
        record = load_run(bag, namespace)
        runs.append(Run(number, bag, record, analyse(record), namespace))
    return runs


def follower_names(runs: Sequence[Run]) -> list[str]:
    """List the names of all runs' followers, by number."""
    found = {follower.name for run in runs for follower in run.analysis.followers}
    return sorted(found, key=lambda name: (len(name), name))


def _place(bag: Path) -> Path:
    """Return the bag's folder, also for its file."""
    place = bag.resolve()
    inside = place.is_file() and (place.parent / METADATA_FILE).is_file()
    return place.parent if inside else place
