"""Colours and tags on the marker, compared: what each sensor sees, how exactly, at what cost, and whole runs.

view: pictures of a neighbour all around the follower, at every 7.5 cm of u and v and nine relative angles, under the
default light, drawn with either marker. A face counts where it is turned to the camera by at least a sixth of its area
(10 degrees). Edges: reported minus true edge of whole Target faces, mean and standard deviation in px. Cost: detection
in one picture, median over pictures of the fastest of three, both sensors in turn.

light: the Target face in formation, over light's strength and colour.

runs: whole runs of both tracks with the same seeds; medians over seeds, a lost run ranks worst. The cost beside them is
of pictures taken about the formation position.

calibration: what config/tags/fine_tuner.yaml holds for `mode: paper`, fitted to the tags' blocks.

Run: python bench/sensors.py [view light runs calibration] [--seeds 0:20] [--predictor formation] [--jobs N]
"""

import argparse
import collections
import itertools
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from robot_formation.analysis.markdown import interval
from robot_formation.analysis.quantities import analyse
from robot_formation.analysis.sweep_summary import median_with_interval
from robot_formation.batch.pool import run_parallel
from robot_formation.cli.sweep import seeds
from robot_formation.components.node_parameters import BlockDetectorNodeParameters
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.experiment.sweep import CONDITIONS
from robot_formation.parameters import from_mapping
from robot_formation.surface import make_surface
from robot_formation.vision.aruco_detector import TagDetector
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.boxes import Box
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.world.camera import Camera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface
from robot_formation.world.sensor import Sensor
from robot_formation.world.tag_faces import FACES

Array = npt.NDArray[np.float64]

KINDS = ("colours", "tags")
PLANE = make_surface("plane")
APART_M = 0.26
HALF, MIDDLE_Z = 0.03, 0.186
TURNED = math.sin(math.radians(10.0))
CUT, OBLIQUE = "cut off by the picture's edge", "oblique (narrower than 0.35 of its height)"
SIZES = ((40.0, "40 px high and more"), (25.0, "25 to 40 px high"), (0.0, "less than 25 px high"))
GROUPS = [*(name for _, name in SIZES), OBLIQUE, CUT]
LIGHTS: dict[str, dict[str, Any]] = {
    "500 lx, white": {},
    "20 lx": {"illuminance_lux": 20.0},
    "5000 lx": {"illuminance_lux": 5000.0},
    "warm (255, 170, 100), balanced": {"light_colour_rgb": (255, 170, 100)},
    "warm, balance off": {
        "light_colour_rgb": (255, 170, 100),
        "auto_white_balance": False,
        "auto_white_balance_on_power_up": False,
    },
}


class Eye:
    """A camera before a marker of one kind, with its sensor."""

    def __init__(self, kind: str, **camera: Any) -> None:
        values = {"marker": {"kind": kind}, "camera": camera}
        self.world = from_mapping(WorldParameters, values, where="bench")
        self.camera = Camera(PLANE, self.world)
        parameters = from_mapping(BlockDetectorNodeParameters, node_defaults("block_detector"), where="bench")
        tags = kind == "tags"
        self.detector = (
            TagDetector(parameters.tags, parameters) if tags else BlockDetector(parameters.load(), parameters)
        )

    def picture(
        self, ahead_m: float, aside_m: float, yaw_rad: float, seed: int
    ) -> tuple[npt.NDArray[np.uint8], Pose, Pose]:
        """A picture of a neighbour so far ahead and to the left, turned so far, and the poses of both robots."""
        looking = pose_on_surface(PLANE, 0.89, 0.5, 0.0)
        seen = pose_on_surface(PLANE, 0.89 + ahead_m, 0.5 + aside_m, yaw_rad)
        sensor = Sensor(self.world.camera, seed, "bench")
        return sensor.expose(sensor.develop(self.camera.light(looking, [seen])), 0.0), looking, seen

    def outlines(self, looking: Pose, seen: Pose) -> dict[Face, Array]:
        """Columns and rows (4, 2) of the faces that are turned to the camera."""
        found = {}
        _, lens = self.camera.optical_frame(looking)
        for face, normal in FACES.items():
            middle = HALF * np.array(normal) + (0.0, 0.0, MIDDLE_Z)
            across = HALF * np.cross((0.0, 0.0, 1.0), normal)
            up = (0.0, 0.0, HALF)
            corners = np.array([middle - across + up, middle + across + up, middle + across - up, middle - across - up])
            corners = corners @ seen.matrix().T + np.array(seen.position)
            to_lens = lens - corners.mean(axis=0)
            if seen.matrix() @ normal @ to_lens / np.linalg.norm(to_lens) > TURNED:
                found[face] = self.camera.project(looking, corners)
        return found


def views() -> Iterator[tuple[float, float, float]]:
    """Poses of the neighbour around the follower: ahead and aside in metres, turn in radians."""
    steps = np.arange(-0.45, 0.451, 0.075)
    for ahead, beyond, degrees in itertools.product(steps, steps, range(-60, 61, 15)):
        aside = 0.32 + beyond
        if aside > 0.0 and math.hypot(ahead, aside) > APART_M:
            yield float(ahead), float(aside), math.radians(degrees)


def sight(corners: Array) -> str:
    """Whether a face is whole in the picture, cut by its edge, or beyond it."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    if (low >= 0.0).all() and high[0] <= 315.0 and high[1] <= 207.0:
        return "whole"
    return "cut" if high[0] > 4.0 and low[0] < 311.0 and high[1] > 4.0 and low[1] < 203.0 else "beyond"


def group(corners: Array) -> str:
    """Name what makes a face easy or hard to see."""
    if sight(corners) == "cut":
        return CUT
    low, high = corners.min(axis=0), corners.max(axis=0)
    width, height = high - low
    if width < 0.35 * height:
        return OBLIQUE
    return next(name for bound, name in SIZES if height >= bound)


def look(detector: BlockDetector | TagDetector, picture: npt.NDArray[np.uint8]) -> tuple[dict[int, Box], float]:
    """Boxes by signature, and the fastest of three detections in milliseconds."""
    times = []
    for _ in range(3):
        begin = time.perf_counter_ns()
        boxes = detector.detect(picture)
        times.append((time.perf_counter_ns() - begin) / 1e6)
    return {box.signature: box for box in boxes}, min(times)


def edges(box: Box, corners: Array) -> Array:
    """Reported minus true left, right, top, bottom."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    reported = (box.x - box.width / 2, box.x + box.width / 2, box.y - box.height / 2, box.y + box.height / 2)
    return np.subtract(reported, (low[0], high[0], low[1], high[1]))


def view() -> None:
    """Print what both sensors see of the neighbour from all around it."""
    eyes = {kind: Eye(kind) for kind in KINDS}
    faces: collections.Counter[tuple[str, str]] = collections.Counter()
    found: collections.Counter[tuple[str, str]] = collections.Counter()
    errors: dict[str, list[Array]] = {kind: [] for kind in KINDS}
    times: dict[str, list[float]] = {kind: [] for kind in KINDS}
    any_face: collections.Counter[str] = collections.Counter()
    for number, pose in enumerate(views()):
        some = False
        for kind, eye in eyes.items():
            picture, looking, seen = eye.picture(*pose, seed=number)
            boxes, took_ms = look(eye.detector, picture)
            times[kind].append(took_ms)
            outlines = {f: c for f, c in eye.outlines(looking, seen).items() if sight(c) != "beyond"}
            some = some or bool(outlines)
            any_face[kind] += bool(outlines) and any(face in boxes for face in outlines)
            for face, corners in outlines.items():
                faces[kind, group(corners)] += 1
                found[kind, group(corners)] += face in boxes
            if Face.TARGET in boxes and Face.TARGET in outlines and sight(outlines[Face.TARGET]) == "whole":
                errors[kind].append(edges(boxes[Face.TARGET], outlines[Face.TARGET]))
        any_face["all"] += some
    print(
        f"\n| seen, of {any_face['all']} views with a face in the picture | faces | colours | tags |\n|---|---|---|---|"
    )
    print("| at least one face | | " + " | ".join(percent(any_face[k], any_face["all"]) for k in KINDS) + " |")
    for name in GROUPS:
        shares = " | ".join(percent(found[kind, name], faces[kind, name]) for kind in KINDS)
        print(f"| a face {name} | {faces['tags', name]} | {shares} |")
    print("\n| Target's edges, px | left | right | top | bottom |\n|---|---|---|---|---|")
    for kind in KINDS:
        values = np.array(errors[kind])
        cells = [f"{m:+.1f} ± {s:.1f}" for m, s in zip(values.mean(axis=0), values.std(axis=0), strict=True)]
        print(f"| {kind} | " + " | ".join(cells) + " |")
    costs = {kind: statistics.median(times[kind]) for kind in KINDS}
    ratio = statistics.median(t / c for t, c in zip(times["tags"], times["colours"], strict=True))
    print(f"\nms per frame: colours {costs['colours']:.2f}, tags {costs['tags']:.2f}, ratio {ratio:.2f}")


def percent(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.0f} %" if whole else "-"


def light() -> None:
    """Print how often the Target face in formation is found under other lights."""
    print("\n| light | colours | tags |\n|---|---|---|")
    count = 50
    for name, camera in LIGHTS.items():
        shares = []
        for kind in KINDS:
            eye = Eye(kind, **camera)
            pictures = (eye.picture(0.0, 0.32, 0.0, seed)[0] for seed in range(count))
            found = sum(any(box.signature == Face.TARGET for box in eye.detector.detect(p)) for p in pictures)
            shares.append(percent(found, count))
        print(f"| {name} | " + " | ".join(shares) + " |")


def cost() -> dict[str, float]:
    """Milliseconds of detection in pictures taken about the formation position, both sensors in turn."""
    eyes = {kind: Eye(kind) for kind in KINDS}
    times: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for number in range(60):
        for kind, eye in eyes.items():
            picture = eye.picture(0.001 * (number - 30), 0.32 + 0.0005 * (number - 30), 0.0, number)[0]
            times[kind].append(look(eye.detector, picture)[1])
    return {kind: statistics.median(found) for kind, found in times.items()}


Result = tuple[str, Mapping[str, Any]]
"""Outcome and totals of a run."""


def one_run(track: str, mode: str, kind: str, predictor: str, seed: int) -> Result:
    """Run a scenario; its analysis, or what is left of it."""
    settings = [*CONDITIONS, f"marker={kind}", f"fine_tuner.mode={mode}", f"predictor.name={predictor}", f"seed={seed}"]
    analysis = analyse(run_in_memory(scenarios.override(scenarios.load_track(track), settings)))
    return analysis.outcome, analysis.followers[0].totals


def runs(chosen: Sequence[int], predictor: str, jobs: int) -> None:
    """Print whole runs with both sensors."""
    cases = list(itertools.product(("one", "two"), ("paper", "precise"), KINDS))
    results = list(run_parallel(one_run, ((*case, predictor, seed) for case in cases for seed in chosen), jobs))
    print(f"\npredictor {predictor}, {len(chosen)} seeds\n")
    print("| track | mode | marker | not finished | formation error (cm) | tags against colours | ", end="")
    print("heading error (deg) | correction (cm) | moves per timestep | out of view (found again) | ms per frame |")
    print("|" + "---|" * 11)
    stories: list[str] = []
    before: Sequence[Result] = []
    costs_ms = cost()
    for number, (track, mode, kind) in enumerate(cases):
        mine = results[number * len(chosen) : (number + 1) * len(chosen)]
        lost = sum(outcome != "done" for outcome, _ in mine)
        cells = [
            median_of(mine, "formation_error_rmse_m", 100.0),
            "-" if kind == "colours" else ratios(mine, before),
            median_of(mine, "heading_error_rmse_rad", math.degrees(1.0)),
            median_of(mine, "correction_m", 100.0),
            median_of(mine, "movements_per_timestep", 1.0),
        ]
        away = sum(len(totals["losses"]) for _, totals in mine)
        back = sum(totals["reacquired"] for _, totals in mine)
        print(
            f"| {track} | {mode} | {kind} | {lost} | "
            + " | ".join(cells)
            + f" | {away} ({back}) | {costs_ms[kind]:.2f} |"
        )
        for seed, (_, totals) in zip(chosen, mine, strict=True):
            stories += [f"track {track}, {mode}, {kind}, seed {seed}: {loss}" for loss in totals["losses"]]
        before = mine
    print("\n" + "\n".join(stories or ["never out of view"]))


def ratios(results: Sequence[Result], others: Sequence[Result]) -> str:
    """Median over seeds of the formation error against that of the other sensor's run of the same seed."""
    values = [
        math.inf if a[0] != "done" else a[1]["formation_error_rmse_m"] / b[1]["formation_error_rmse_m"]
        for a, b in zip(results, others, strict=True)
        if b[0] == "done"
    ]
    return interval(median_with_interval(values), 1.0, 2)


def median_of(results: Sequence[Result], name: str, scale: float) -> str:
    values = [math.inf if outcome != "done" else totals[name] for outcome, totals in results]
    return interval(median_with_interval([value for value in values if value is not None]), scale, 2)


def calibration() -> None:
    """Print the paper mode's calibration for tags, fitted at the formation's distance and along u."""
    eye = Eye("tags")

    def target(ahead_m: float, aside_m: float, seed: int) -> Box:
        return next(
            box for box in eye.detector.detect(eye.picture(ahead_m, aside_m, 0.0, seed)[0]) if box.signature == 1
        )

    ahead = np.repeat(np.arange(-0.03, 0.0301, 0.0025), 10)
    columns = [target(place, 0.32, seed).x for seed, place in enumerate(ahead)]
    slope, middle = np.polyfit(ahead, columns, 1)
    aside = np.repeat(np.arange(0.26, 0.4801, 0.01), 10)
    boxes = [target(0.0, place, seed) for seed, place in enumerate(aside)]
    distances = aside - HALF - eye.world.camera.y_m
    side_px_m = eye.world.camera.focal_length_px * eye.world.marker.edge_m
    bias = np.mean(side_px_m / distances - [max(box.width, box.height) for box in boxes])
    print(f"\ntarget_x_px {middle:.1f}, slope_px_per_m {slope:.0f}, side_px_m {side_px_m:.2f}, side_bias_px {bias:.2f}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", default=["view", "light", "runs", "calibration"], help="default: all")
    parser.add_argument("--seeds", default="0:20", help="seeds of the runs (default: 0:20)")
    parser.add_argument("--predictor", default="formation", help="predictor of the runs (default: formation)")
    parser.add_argument("--jobs", type=int, default=1, help="runs at the same time (default: 1)")
    args = parser.parse_args()
    parts: dict[str, Callable[[], None]] = {
        "view": view,
        "light": light,
        "runs": lambda: runs(seeds(args.seeds), args.predictor, args.jobs),
        "calibration": calibration,
    }
    for part in args.parts:
        if part not in parts:
            parser.error(f"no part '{part}'; there are {', '.join(parts)}")
        parts[part]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
