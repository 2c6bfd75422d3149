"""The overhead tracker's error against ground truth on the paper's tracks, with the good and the imperfect calibration.

Run: python bench/overhead.py [--seeds N] [--picture FILE]
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.plotting import new_figure, save_figure
from robot_formation.analysis.style import ORANGE, SKY
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import load_track, override
from robot_formation.launching.processes import run_metadata
from robot_formation.surface import make_surface
from robot_formation.vision.overhead.tracking_parameters import UsedCalibration
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
    """Write the first picture of track two, brighter and without noise, with contour lines, a scale and names."""
    surface, parameters = make_surface("bowl"), WorldParameters()
    camera = OverheadCamera(surface, parameters, 3)
    poses = [pose_on_surface(surface, x, y, 0.75 * np.pi) for x, y in ((1.412, 0.111), (1.638, 0.337))]
    figure = new_figure(6.4, 6.2)
    axes = figure.subplots()
    axes.imshow(camera.view(poses), cmap="gray", vmin=20, vmax=170)
    ticks = np.linspace(0.0, surface.size_m, 80)
    x, y = np.meshgrid(ticks, ticks)
    heights = surface.heights(x, y)
    columns, rows = camera.project(np.stack([x, y, heights], axis=-1).reshape(-1, 3)).T.reshape(2, *x.shape)
    lines = axes.contour(columns, rows, heights * 1e3, levels=range(60, 201, 20), colors=SKY, linewidths=0.7)
    axes.clabel(lines, fmt="%g mm", fontsize=7)
    ends = np.array([(1.08 + 0.5 * end, 1.70, surface.height(1.08 + 0.5 * end, 1.70)) for end in (0, 1)])
    axes.plot(*camera.project(ends).T, color="white", linewidth=2.5)
    axes.text(*camera.project(ends.mean(axis=0)[None])[0] + (0, -6), "50 cm", color="white", ha="center")
    for name, colour, pose in zip(("leader", "follower 1"), (ORANGE, SKY), poses, strict=True):
        column, row = camera.project(np.array([pose.position]))[0]
        arrow = {"arrowstyle": "-", "color": colour}
        axes.annotate(name, (column, row), (column - 95, row - 40), color=colour, arrowprops=arrow, ha="center")
    axes.set(xlabel="column (px)", ylabel="row (px)", title="overhead camera, contrast raised, heights drawn in")
    save_figure(figure, file)


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
