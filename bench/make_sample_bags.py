"""Makes the sample bags in bags/samples anew: what the docs show and the tests analyse.

Both tracks with each predictor that the README compares, without pictures, and one short run with pictures. They come
from the node graph, so they hold what a user's bag holds.

Run: python bench/make_sample_bags.py [--out FOLDER] [--only NAME ...] [--check]
"""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import Scenario
from robot_formation.launching.launcher import Launcher
from robot_formation.launching.processes import run_metadata
from robot_formation.paths import default_bags_dir

TRACKS = ("one", "two")
PREDICTORS = ("previous", "measured", "formation")
SEED = 3
TOLERANCE = 1e-9  # between machines; on one machine nothing differs
# Without block filtering a look is over after three pictures: a picture takes 0.13 MB, since noise does not compress.
FEW_PICTURES = (
    "predictor.name=measured",
    "leader.timesteps=1",
    "block_detector.block_filtering=0",
    "fine_tuner.look.frames=3",
)


@dataclass(frozen=True)
class Sample:
    """A sample bag: its name, and the run that it holds."""

    name: str
    track: str
    settings: tuple[str, ...]
    images: bool = False

    def scenario(self) -> Scenario:
        """Put the run together."""
        common = (f"seed={SEED}", "world.camera.mode=on_demand", "fine_tuner.mode=paper")
        scenario = scenarios.override(scenarios.load_track(self.track), [*common, *self.settings])
        scenario.check()
        return scenario


SAMPLES = {
    sample.name: sample
    for sample in (
        *(Sample(f"track_{t}_{p}", t, (f"predictor.name={p}",)) for t in TRACKS for p in PREDICTORS),
        Sample("pictures", "two", FEW_PICTURES, images=True),
    )
}


def make(sample: Sample, folder: Path) -> Path:
    """Run the scenario; return its bag in the folder.

    Raises:
        FormationError: if the run doesn't come to its end.
    """
    result = Launcher(sample.scenario(), folder / sample.name, images=sample.images).run()
    if result.exit_code or result.bag is None:
        raise FormationError(f"{sample.name}: the run ended with exit code {result.exit_code}: {result.reason}")
    return result.bag


def changes(sample: Sample, folder: Path) -> list[str]:
    """Run the scenario again, in this process; say where its analysis differs from that of the bag.

    Raises:
        FormationError: if the run doesn't come to its end, or the bag can't be read.
    """
    scenario = sample.scenario()
    with tempfile.TemporaryDirectory() as new:
        result = run_in_process(scenario, Path(new) / "today", run_metadata(scenario))
        if result.exit_code:
            raise FormationError(f"{sample.name}: the run ended with exit code {result.exit_code}: {result.reason}")
        return list(differences(analysis_of(folder / sample.name), analysis_of(Path(new) / "today")))


def analysis_of(bag: Path) -> Any:
    """Analyse a bag: what `formation analyze --json` prints."""
    return analyse(load_run(bag)).to_json()


def differences(one: Any, other: Any, where: str = "") -> Iterator[str]:
    """Say where two JSON values differ: numbers by more than the tolerance, everything else at all."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in one.keys() | other.keys():
            yield from differences(one.get(key), other.get(key), f"{where}.{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{where}[{number}]")
    elif isinstance(one, float) and isinstance(other, (int, float)):
        if not math.isclose(one, other, rel_tol=0.0, abs_tol=TOLERANCE):
            yield f"{where}: {one} and {other}"
    elif one != other:
        yield f"{where}: {one} and {other}"


def remake(names: list[str], folder: Path) -> int:
    """Make the bags and put them in the place of the old ones, which stay if any run fails; return the exit code."""
    folder.mkdir(parents=True, exist_ok=True)
    total = 0
    with tempfile.TemporaryDirectory(prefix=".new_", dir=folder) as new:
        # Bags name the commit, and would say that it has been changed once an old one is replaced.
        bags = [make(SAMPLES[name], Path(new)) for name in names]
        for bag in bags:
            target = folder / bag.name
            if target.exists():
                shutil.rmtree(target)
            bag.rename(target)
            size = sum(file.stat().st_size for file in target.iterdir())
            total += size
            print(f"{target}: {size / 1e6:.2f} MB", flush=True)
    print(f"together {total / 1e6:.2f} MB")
    return 0


def check(names: list[str], folder: Path) -> int:
    """Tell which bags are not what their runs give today; return 1 if there are such."""
    code = 0
    for name in names:
        found = changes(SAMPLES[name], folder)
        code = code or int(bool(found))
        print(f"{name}: " + (f"{len(found)} differences, as {found[0]}" if found else "as today"), flush=True)
    return code


def main() -> int:
    """Make the bags anew, or only check them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="default: bags/samples")
    parser.add_argument(
        "--only", metavar="NAME", nargs="+", default=list(SAMPLES), choices=SAMPLES, help="some of them"
    )
    parser.add_argument("--check", action="store_true", help="make none; tell which ones would be others today")
    args = parser.parse_args()
    folder = args.out or default_bags_dir() / "samples"
    try:
        return check(args.only, folder) if args.check else remake(args.only, folder)
    except FormationError as error:
        print(f"make_sample_bags: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
