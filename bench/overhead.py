"""The overhead tracker's error against ground truth on the paper's tracks, with the good and the imperfect calibration.

Run: python bench/overhead.py [--seeds N] [--picture FILE]
"""

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from robot_formation.analysis.from_bag import load_run
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import load_track, override
from robot_formation.launching.processes import run_metadata
from robot_formation.surface import make_surface
from robot_formation.vision.overhead.dot_tracking import UsedCalibration
from robot_formation.world.overhead import OverheadCamera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface

TRACKS = ("one", "one_baseline", "two", "two_baseline")
CM = 100.0


def errors_of(track: str, seed: int, calibration: str) -> dict[str, npt.NDArray[np.float64]]:
    """Errors by robot (pictures,) in metres of one run, of which nothing is kept."""
    settings = [
        f"seed={seed}",
        "predictor.name=measured",
        "world.camera.mode=on_demand",
        f"overhead_tracker.calibration={calibration}",
    ]
    scenario = override(load_track(track), settings)
    with tempfile.TemporaryDirectory() as folder:
        run_in_process(scenario, Path(folder) / "run", run_metadata(scenario))
        return {robot: seen.errors_m for robot, seen in load_run(Path(folder) / "run").overhead.items()}


def draw(file: Path) -> None:
    """Write the first picture of track two."""
    surface, parameters = make_surface("bowl"), WorldParameters()
    camera = OverheadCamera(surface, parameters, 3)
    robots = [pose_on_surface(surface, x, y, 0.75 * np.pi) for x, y in ((1.412, 0.111), (1.638, 0.337))]
    cv2.imwrite(str(file), camera.frame(robots, 0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="seeds 0 to N - 1 of each track (default 5)")
    parser.add_argument("--picture", type=Path, help="write an overhead picture to this file and do nothing else")
    arguments = parser.parse_args()
    if arguments.picture:
        draw(arguments.picture)
        return
    print(f"overhead error in cm, {arguments.seeds} seeds: RMS, and largest of a run (least and greatest of the runs)")
    print(f"{'track':14s}{'calibration':13s}{'pictures':>9s}   {'leader':>20s}   {'follower_1':>20s}")
    for track in TRACKS:
        for calibration in UsedCalibration:
            runs = [errors_of(track, seed, calibration) for seed in range(arguments.seeds)]
            cells = []
            for robot in ("leader", "follower_1"):
                rms = CM * np.sqrt(np.mean(np.concatenate([run[robot] for run in runs]) ** 2))
                largest = [CM * run[robot].max() for run in runs]
                cells.append(f"{rms:5.3f}, {min(largest):5.3f}..{max(largest):5.3f}".rjust(20))
            pictures = sum(len(run["leader"]) for run in runs)
            print(f"{track:14s}{calibration:13s}{pictures:9d}   {'   '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
