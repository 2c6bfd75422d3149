"""Draws the pictures of README and docs: two of a real run by the code of `formation analyze`, and two explanations.

Run: python bench/readme_pictures.py [--out FOLDER]
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from matplotlib.axes._axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle, Wedge

from robot_formation.analysis.figures import draw_corrections, draw_trajectory
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import load_track, with_value
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.launching.processes import run_metadata
from robot_formation.parameters import from_mapping
from robot_formation.paths import config_dir
from robot_formation.surface import make_surface
from robot_formation.surface.bowl import Bowl
from robot_formation.vision.aruco_detector import TagDetector
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.signatures import load_signatures
from robot_formation.world.camera import Camera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface
from robot_formation.world.sensor import Sensor

PICTURES = Path(__file__).parent.parent / "docs" / "pictures"
SEED = 3
SLOTS_AHEAD_M = (-0.1, 0.15)
HEIGHTS_MM = (60, 80, 100, 120, 140, 160, 180)
WORLD = WorldParameters()
LEADER_COLOUR, FOLLOWER_COLOUR = "#E69F00", "#0072B2"
FACES = {"Target": "#D62718", "Front": "#2E9E3B", "Rear": "#2B4FD0"}
ARROW: dict[str, Any] = {
    "width": 0.0,
    "head_width": 0.016,
    "head_length": 0.022,
    "length_includes_head": True,
    "zorder": 5,
}
BACKED: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}


def draw_run(folder: Path) -> None:
    """Run track two and draw its trajectory and corrections."""
    scenario = with_value(load_track("two"), "seed", SEED)
    with tempfile.TemporaryDirectory() as temporary:
        bag = Path(temporary) / "run"
        run_in_process(scenario, bag, run_metadata(scenario))
        record = load_run(bag)
    analysis = analyse(record)
    draw_trajectory(record, analysis, folder / "track_two.png")
    draw_corrections(record, analysis, folder / "corrections.png")


def corners(x: float, y: float, heading: float, length: float, width: float) -> npt.NDArray[np.float64]:
    """Corners (4, 2) of a rectangle about (x, y) whose length lies along the heading."""
    half = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * (length / 2, width / 2)
    c, s = math.cos(heading), math.sin(heading)
    found: npt.NDArray[np.float64] = half @ np.array([(c, s), (-s, c)]) + (x, y)
    return found


def draw_frames(folder: Path) -> None:
    """Draw the plate's axes beside a formation from above: axes, marker faces, camera, distances."""
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    plate, formation = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    _draw_plate(plate)
    _draw_formation(formation)
    figure.savefig(folder / "frames.png", dpi=130)


def _draw_plate(axes: Axes) -> None:
    surface = Bowl()
    size = surface.size_m
    ticks = np.linspace(0.0, size, 90)
    xs, ys = np.meshgrid(ticks, ticks)
    lines = axes.contour(xs, ys, surface.heights(xs, ys) * 1e3, levels=HEIGHTS_MM, colors="0.75", linewidths=0.8)
    middle = size / 2.0
    radii = [
        math.sqrt((level * 1e-3 - surface.height(middle, middle)) / surface.curvature_per_m) for level in HEIGHTS_MM
    ]
    diagonal = math.sqrt(0.5)
    axes.clabel(lines, fmt="%g mm", fontsize=7, manual=[(middle - diagonal * r, middle + diagonal * r) for r in radii])
    axes.add_patch(Rectangle((0, 0), size, size, fill=False, edgecolor="0.3"))
    for track, heading, label in (((0.763, 0.158), 90.0, "track one"), ((1.412, 0.111), 135.0, "track two")):
        yaw = math.radians(heading)
        right = np.array([math.sin(yaw), -math.cos(yaw)]) * FORMATION_DISTANCE_M
        for place, colour in ((np.array(track), LEADER_COLOUR), (np.array(track) + right, FOLLOWER_COLOUR)):
            outline = corners(float(place[0]), float(place[1]), yaw, WORLD.chassis.length_m, WORLD.chassis.width_m)
            axes.add_patch(Polygon(outline, facecolor=colour, edgecolor="black", alpha=0.55, zorder=3))
            step = np.array([math.cos(yaw), math.sin(yaw)]) * 0.3
            axes.arrow(*place, *step, color="black", width=0.003, head_width=0.04, zorder=5)
        x, y = np.array(track) + 0.5 * right + 1.5 * step
        axes.text(x, y, label, ha="center", bbox=BACKED, zorder=6)
    for direction, name in (((1, 0), "x"), ((0, 1), "y")):
        axes.arrow(0, 0, *(np.array(direction) * 0.42), color="black", width=0.006, head_width=0.05, zorder=6)
        x, y = np.array(direction) * 0.50 + 0.05
        axes.text(x, y, name, fontsize=12, fontweight="bold", bbox=BACKED, zorder=7)
    axes.plot(0, 0, "ko", markersize=6, clip_on=False, zorder=6)
    axes.set(xlim=(-0.06, size + 0.16), ylim=(-0.12, size + 0.06), aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.set_title("world: the plate's corner, metres", fontsize=11)
    axes.spines[["top", "right"]].set_visible(False)


def _draw_formation(axes: Axes) -> None:
    """The formation seen from above, driving up the page: right of the page is -y of both robots."""
    gap = FORMATION_DISTANCE_M
    for x, colour, name in ((0.0, LEADER_COLOUR, "leader"), (gap, FOLLOWER_COLOUR, "follower_1")):
        _draw_robot(axes, x, colour, name)
    lens = gap - WORLD.camera.y_m
    view = math.degrees(2.0 * math.atan(WORLD.camera.width_px / 2.0 / WORLD.camera.focal_length_px))
    axes.add_patch(Wedge((lens, 0), 0.62, 180 - view / 2, 180 + view / 2, color="#F0B030", alpha=0.16, zorder=1))
    axes.plot(lens, 0, marker="<", markerfacecolor="#F0B030", markeredgecolor="black", markersize=10, zorder=7)
    axes.annotate("lens, looks left\n(+y of base_link)", (lens, -0.008), (lens + 0.15, -0.13), ha="center",
                  fontsize=9, arrowprops={"arrowstyle": "-", "color": "0.3"}, zorder=8)  # fmt: skip
    for x in (0.0, gap):
        axes.plot([x, x], [-0.02, -0.285], color="0.4", linewidth=0.8, linestyle=":", zorder=4)
    _dimension(axes, 0.0, gap, -0.275, f"{gap * 100:g} cm between base_link origins")
    face = WORLD.marker.edge_m / 2
    for x in (face, lens):
        axes.plot([x, x], [-0.02, -0.225], color="0.4", linewidth=0.8, linestyle=":", zorder=4)
    _dimension(axes, face, lens, -0.215, f"{(lens - face) * 100:.1f} cm lens to face")
    _axes_of_motion(axes, gap)
    axes.set(xlim=(-0.29, 0.62), ylim=(-0.33, 0.42), aspect="equal")
    axes.set_axis_off()
    axes.set_title("formation from above, driving up the page", fontsize=11)


def _draw_robot(axes: Axes, x: float, colour: str, name: str) -> None:
    outline = corners(x, 0.0, math.pi / 2, WORLD.chassis.length_m, WORLD.chassis.width_m)
    axes.add_patch(Polygon(outline, facecolor=colour, edgecolor="black", alpha=0.30, zorder=2))
    half = WORLD.marker.edge_m / 2
    axes.add_patch(Rectangle((x - half, -half), 2 * half, 2 * half, facecolor="0.2", zorder=3))
    style: dict[str, Any] = {"linewidth": 5, "solid_capstyle": "butt", "zorder": 6}
    axes.plot([x + half, x + half], [-half, half], color=FACES["Target"], **style)
    axes.plot([x - half, x + half], [half, half], color=FACES["Front"], **style)
    axes.plot([x - half, x + half], [-half, -half], color=FACES["Rear"], **style)
    axes.plot(x, 0, "o", color="white", markersize=5, zorder=7)
    axes.text(x - 0.105, -0.165, name, ha="left", fontsize=10, fontweight="bold", zorder=7)


def _axes_of_motion(axes: Axes, gap: float) -> None:
    axes.arrow(gap, 0.0, 0.0, 0.30, color="black", **{**ARROW, "width": 0.003})
    axes.text(gap + 0.012, 0.27, "v = +x\n(forward)", fontsize=10, va="center", zorder=8)
    axes.arrow(gap, 0.0, 0.24, 0.0, color="black", **{**ARROW, "width": 0.003})
    axes.text(gap + 0.135, 0.03, "u = -y (right)", fontsize=10, zorder=8)
    axes.arrow(0.0, 0.0, 0.0, 0.30, color="0.35", **{**ARROW, "width": 0.002})
    axes.text(-0.012, 0.28, "x", fontsize=11, color="0.25", ha="right")
    axes.arrow(0.0, 0.0, -0.20, 0.0, color="0.35", **{**ARROW, "width": 0.002})
    axes.text(-0.20, 0.02, "y", fontsize=11, color="0.25")
    handles = [axes.plot([], [], color=colour, linewidth=5, label=name)[0] for name, colour in FACES.items()]
    axes.legend(handles=handles, title="marker faces", loc="upper left", ncols=3, frameon=False, fontsize=9,
                title_fontsize=9, handlelength=1.2)  # fmt: skip


def _dimension(axes: Axes, left: float, right: float, y: float, text: str) -> None:
    axes.annotate(
        "", (left, y), (right, y), arrowprops={"arrowstyle": "<->", "color": "0.2", "shrinkA": 0, "shrinkB": 0}
    )
    axes.text((left + right) / 2, y - 0.008, text, ha="center", va="top", fontsize=9, zorder=8)


def _detector() -> BlockDetector:
    parameters = from_mapping(
        DetectorParameters, {"signature_range": [5.0, 6.0, 6.0], "max_merge_dist": 4}, where="bench"
    )
    return BlockDetector(load_signatures(config_dir() / "signatures.yaml"), parameters)


def draw_view(folder: Path) -> None:
    """Draw what a follower's camera sees in formation and 12 cm ahead of it, with its blocks."""
    _draw_blocks(folder / "camera.jpg", _detector(), [_view(WORLD), _view(WORLD, ahead_m=0.12)])


def draw_boards(folder: Path) -> None:
    """Draw a neighbour and, 5 cm ahead of it, the robot farther left, without and with boards behind the markers."""
    detector = BlockDetector(load_signatures(config_dir() / "signatures.yaml"), DetectorParameters())
    boards = [from_mapping(WorldParameters, {"marker": {"backdrop_m": width}}, where="bench") for width in (0.0, 0.16)]
    _draw_blocks(folder / "boards.jpg", detector, [_view(world, farther_ahead_m=0.05) for world in boards])


def draw_slots(folder: Path) -> None:
    """Draw what a follower sees of its neighbour from a slot behind and from one ahead."""
    _draw_blocks(folder / "slots.jpg", _detector(), [_view(WORLD, ahead_m=offset_m) for offset_m in SLOTS_AHEAD_M])


def draw_tags(folder: Path) -> None:
    """Draw the marker of tags in formation, and from behind and aside with the leader turned."""
    world = from_mapping(WorldParameters, {"marker": {"kind": "tags"}}, where="bench")
    turned = _view(world, ahead_m=-0.08, away_m=0.06, yaw_rad=math.radians(35.0))
    _draw_blocks(folder / "tags.jpg", TagDetector(), [_view(world), turned])


def _view(
    world: WorldParameters,
    *,
    ahead_m: float = 0.0,
    away_m: float = 0.0,
    yaw_rad: float = 0.0,
    farther_ahead_m: float | None = None,
) -> npt.NDArray[np.uint8]:
    """Take a follower's picture from ahead of its place and farther away, of a neighbour that has turned.

    With `farther_ahead_m` another robot stands on the neighbour's left, so far ahead of it.
    """
    plane = make_surface("plane")
    looking = pose_on_surface(plane, 0.9 + ahead_m, 0.6 - away_m, 0.0)
    seen = [pose_on_surface(plane, 0.9, 0.6 + FORMATION_DISTANCE_M, yaw_rad)]
    if farther_ahead_m is not None:
        seen.append(pose_on_surface(plane, 0.9 + farther_ahead_m, 0.6 + 2.0 * FORMATION_DISTANCE_M, 0.0))
    sensor = Sensor(world.camera, SEED, "follower_1")
    return sensor.expose(sensor.develop(Camera(plane, world).light(looking, seen)), 0.0)


def _draw_blocks(path: Path, detector: BlockDetector | TagDetector, views: Sequence[npt.NDArray[np.uint8]]) -> None:
    """Draw two pictures side by side with their blocks, enlarged twice."""
    pictures = []
    for picture in views:
        large = cv2.resize(picture, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
        for block in detector.detect(picture):
            left, top = 2 * block.x - block.width, 2 * block.y - block.height
            cv2.rectangle(large, (left, top), (left + 2 * block.width, top + 2 * block.height), (255, 255, 255), 2)
            text = f"{('', 'Target', 'Front', 'Rear')[block.signature]} {block.width} x {block.height}"
            # The faces touch: the Target's label goes above, the others' to their outer side, before the light wall.
            beside = {1: (left, top - 8), 2: (left + 2 * block.width + 12, top + 40), 3: (left - 92, top + 40)}
            origin = beside[block.signature]
            cv2.putText(large, text, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
        pictures.append(large)
    gap = np.full((pictures[0].shape[0], 12, 3), 255, np.uint8)
    both = np.hstack([pictures[0], gap, pictures[1]])
    # Noise makes a PNG of half a megabyte.
    cv2.imwrite(str(path), cv2.cvtColor(both, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 90])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder (default: docs/pictures)")
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    for draw in (draw_run, draw_frames, draw_view, draw_boards, draw_slots, draw_tags):
        draw(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
