"""Makes the sample bags in bags/samples anew: what the docs show and the tests analyse.

Both tracks with each predictor that the README compares, without pictures, and one short run with pictures. They come
from the node graph, so they hold what a user's bag holds.

Run: python bench/make_sample_bags.py [--out FOLDER] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.scenario import Scenario
from robot_formation.launching.launcher import Launcher
from robot_formation.paths import default_bags_dir

TRACKS = ("one", "two")
PREDICTORS = ("previous", "measured", "formation")
SEED = 3
# Without block filtering a look is over after three pictures: a picture takes 0.13 MB, since noise does not compress.
FEW_PICTURES = ("leader.timesteps=1", "block_detector.block_filtering=0", "fine_tuner.look.frames=3")


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
    """Run the scenario and put its bag in the place of the old one.

    Raises:
        FormationError: if the run doesn't come to its end; the old bag stays.
    """
    with tempfile.TemporaryDirectory(prefix=".new_", dir=folder) as new:
        result = Launcher(sample.scenario(), Path(new) / sample.name, images=sample.images).run()
        if result.exit_code or result.bag is None:
            raise FormationError(f"{sample.name}: the run ended with exit code {result.exit_code}: {result.reason}")
        target = folder / sample.name
        if target.exists():
            shutil.rmtree(target)
        result.bag.rename(target)
    return target


def main() -> int:
    """Make the bags; tell each one's size."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="default: bags/samples")
    parser.add_argument(
        "--only", metavar="NAME", nargs="+", default=list(SAMPLES), choices=SAMPLES, help="some of them"
    )
    args = parser.parse_args()
    folder = args.out or default_bags_dir() / "samples"
    folder.mkdir(parents=True, exist_ok=True)
    total = 0
    for name in args.only:
        try:
            bag = make(SAMPLES[name], folder)
        except FormationError as error:
            print(f"make_sample_bags: {error}", file=sys.stderr)
            return 2
        size = sum(file.stat().st_size for file in bag.iterdir())
        total += size
        print(f"{bag}: {size / 1e6:.2f} MB", flush=True)
    print(f"together {total / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
