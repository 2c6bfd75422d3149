"""Where the detector reports the marker's edges against where they are: the figures behind `precise.edges`.

Two robots stand on the default bowl at random places: near the formation and nearly parallel, as at the places that
the first alignment looks from, and anywhere in view. The true pose is put through the marker's projection; printed are
reported minus projected edges, by reported width where the error jumps, and how often a face of some width is reported.

With --board a light board stands behind the marker, as in a chain with rigid spacing.

Run: python bench/marker_edges.py [--looks 4000] [--seed 1] [--jobs N] [--board]
"""

import argparse
import math
import os
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from alignment_grid import equipment
from robot_formation import names
from robot_formation.alignment.observation import FaceBox
from robot_formation.alignment.precise.marker_edges import (
    Edge,
    EdgeParameters,
    mean_boxes,
    one_marker,
)
from robot_formation.alignment.precise.marker_projection import GeometryParameters, MarkerModel
from robot_formation.batch.pool import run_parallel
from robot_formation.calibration.alignment_trial import FOLLOWER, Equipment, Start, poses
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.picture import WIDTH
from robot_formation.world.checks import WorldError
from robot_formation.world.events import Frame
from robot_formation.world.pose import Pose
from robot_formation.world.world import World

MODEL, EDGES = MarkerModel(GeometryParameters()), EdgeParameters()
BOARD = ("world.marker.backdrop_m=0.16",)
OUTER = {Face.FRONT: "right", Face.REAR: "left"}
NAMES = {Face.TARGET: "Target", Face.FRONT: "Front", Face.REAR: "Rear"}


Place = tuple[float, float, float]
Look = tuple[npt.NDArray[np.float64], Mapping[Face, FaceBox]]


def near(rng: np.random.Generator) -> Place:
    """Neighbour ahead [m], to the left [m], yaw [rad]: near the formation and nearly parallel."""
    return rng.uniform(-0.17, 0.17), rng.uniform(0.29, 0.37), math.radians(rng.uniform(-9.0, 9.0))


def anywhere(rng: np.random.Generator) -> Place:
    """Neighbour ahead [m], to the left [m], yaw [rad]: anywhere in view."""
    left, bearing = rng.uniform(0.3, 0.75), rng.uniform(-0.45, 0.45)
    return (left - 0.04) * math.tan(bearing), left, math.radians(rng.uniform(-50.0, 50.0))


def between(follower: Pose, leader: Pose) -> npt.NDArray[np.float64]:
    """The leader's state (6,) as `marker_projection` has it, from both robots' poses in the world."""
    rotation = follower.matrix().T @ leader.matrix()
    place = follower.matrix().T @ (np.array(leader.position) - np.array(follower.position))
    yaw = math.atan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
    tilt = rotation @ cv2.Rodrigues(np.array((0.0, 0.0, -yaw)))[0]
    roll, pitch = 0.5 * (tilt[2, 1] - tilt[1, 2]), 0.5 * (tilt[0, 2] - tilt[2, 0])
    x, y, _ = cv2.Rodrigues(np.array((-0.5 * roll, -0.5 * pitch, 0.0)))[0] @ place
    # Curvatures are more numbers than tilts; of those that give these tilts, the smallest. The picture is the same.
    curvatures = np.linalg.lstsq(np.array(((y, y, x), (-x, x, -y))), np.array((roll, pitch)), rcond=None)[0]
    return np.array((x, y, yaw, *curvatures))


def look(made: Equipment, start: Start, seed: int) -> Look | None:
    """One look: the true state and the mean boxes, or None where the robots overlap."""
    try:
        world = World(made.surface, poses(made.surface, start), made.world, seed=seed)
    except WorldError:
        return None
    detector = BlockDetector(made.detector.load(), made.detector)
    frames: list[Sequence[Block]] = []
    try:
        world.request_frames(FOLLOWER, made.fine_tuner.look.frames)
        while events := world.advance():
            for event in events:
                if isinstance(event, Frame):
                    frames.append(detector.process(event.image, event.stamp_ns // 1000))
        state = between(world.ground_truth(FOLLOWER).pose, world.ground_truth(names.LEADER).pose)
    finally:
        world.close()
    last = frames[-made.fine_tuner.precise.averaged_frames :]
    return state, mean_boxes([one_marker(blocks, lambda block: -block.width * block.height) for blocks in last])


def looks(place: Callable[[np.random.Generator], Place], count: int, seed: int, board: bool) -> list[Look]:
    """Looks from random places."""
    rng, made = np.random.default_rng(seed), equipment("precise", BOARD if board else ())
    found: list[Look | None] = []
    for number in range(count):
        ahead, left, yaw = place(rng)
        c, s = math.cos(yaw), math.sin(yaw)
        start = Start(c * left - s * ahead, -(c * ahead + s * left), math.degrees(yaw))
        found.append(look(made, start, 1000 * seed + number))
    return [entry for entry in found if entry is not None]


def errors(found: Sequence[Look]) -> tuple[dict[str, list[float]], dict[Face, list[tuple[float, bool]]]]:
    """Reported minus true edges [px], by a description of the edge; and widths of faces with whether they are seen."""
    edges: defaultdict[str, list[float]] = defaultdict(list)
    shown: defaultdict[Face, list[tuple[float, bool]]] = defaultdict(list)
    for state, boxes in found:
        columns, widths = MODEL.pixels(state[None])[0, :, 0], MODEL.widths(state)
        if Face.TARGET not in boxes or columns.min() < 3.0 or columns.max() > WIDTH - 4.0:
            continue
        target = boxes[Face.TARGET]
        view = "clear" if EDGES.clear(target) else "rough"
        for face, side in OUTER.items():
            shown[face].append((widths[face], face in boxes))
            if face in boxes:
                band = EDGES.front_band if face == Face.FRONT else EDGES.rear_band
                where = f"band {band(boxes[face].width)}" if view == "clear" else "any width"
                edges[f"{NAMES[face]} {side}, {view}, {where}"].append(_error(state, boxes, face, side))
        if Face.FRONT in boxes:
            edges["Front left"].append(_error(state, boxes, Face.FRONT, "left"))
            continue
        edges["Target left, no Front"].append(_error(state, boxes, Face.TARGET, "left"))
        hidden = min(10, math.floor(max(0.0, widths[Face.FRONT])))
        edges[f"Target right, Front of {hidden:2d} px not reported"].append(_error(state, boxes, Face.TARGET, "right"))
        for side in ("top", "bottom"):
            edges[f"Target {side}, no Front"].append(_error(state, boxes, Face.TARGET, side))
    return edges, shown


def _error(state: npt.NDArray[np.float64], boxes: Mapping[Face, FaceBox], face: Face, side: str) -> float:
    reported: float = getattr(boxes[face], side)
    return reported - float(MODEL.edges(state[None], [Edge(face, side, 0.0, 1.0)])[0, 0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--looks", type=int, default=4000, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--board", action="store_true", help="with a light board behind the marker")
    args = parser.parse_args()
    for title, place in (("near the formation", near), ("anywhere in view", anywhere)):
        parts = ((place, args.looks // 16, 16 * args.seed + part, args.board) for part in range(16))
        found = [entry for part in run_parallel(looks, parts, args.jobs) for entry in part]
        edges, shown = errors(found)
        print(f"{title}: {len(found)} looks\n\n| edge | looks | mean error, px | scatter, px |\n|---|---|---|---|")
        for name, values in sorted(edges.items()):
            print(f"| {name} | {len(values)} | {np.mean(values):.2f} | {np.std(values):.2f} |")
        for face, pairs in shown.items():
            table = np.array(pairs)
            print(f"\n{NAMES[face]} face, true width in px: share reported")
            for low in range(3, 20):
                inside = (table[:, 0] >= low) & (table[:, 0] < low + 1)
                print(f"{low}: {table[inside, 1].mean():.0%}" if inside.any() else f"{low}: -", end="  ")
            print()
        print()


if __name__ == "__main__":
    main()
