"""Draws the leader's paths for docs/reference/paths.md: the planned track of each, and where the leader looks.

Run: python bench/path_pictures.py [--out FOLDER]
"""

import argparse
import math
import sys
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.geometry.slots import leader_places, slot
from robot_formation.leader.paths import Given, make_path, poses
from robot_formation.leader.rigid_formation import Formation, room_around

PICTURES = Path(__file__).parent.parent / "docs" / "pictures"
PLATE_M, START = 1.78, Motion(0.7, 0.8, 0.5 * math.pi)
PANELS = (
    ("straight", (), 12),
    ("circle", ("phase=0",), 12),
    ("circle", ("heading=along", "direction=right", "radius_m=0.6"), 30),
    ("arc", ("before=4",), 27),
    ("slalom", ("phase=0",), 24),
    ("pulse", ("phase=0",), 24),
    ("lemniscate", ("phase=0",), 36),
    ("lissajous", ("phase=0",), 60),
    ("stadium", ("phase=0",), 62),
    ("clothoid", ("phase=0",), 34),
    ("switch", ("parts=straight:6 slalom:12 circle:12", "slalom.phase=0", "circle.phase=0"), 30),
    ("random_walk", (), 60),
)
TRACK_COLOUR, HEADING_COLOUR = "#0072B2", "#E69F00"


def draw(folder: Path) -> None:
    """Draw one panel per path, all at the same scale, forward upwards."""
    figure = Figure(figsize=(11.0, 9.6), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, texts, timesteps) in zip(figure.subplots(3, 4).flat, PANELS, strict=True):
        room = room_around(Formation(leader_places([slot(FORMATION_DISTANCE_M)]), 0.365, 0.238), START, PLATE_M)
        track = poses(make_path(name, texts, Given(seed=4, room=room)), timesteps)
        ahead, left = [pose.x_m for pose in track], [pose.y_m for pose in track]
        axes.plot(left, ahead, "-o", color=TRACK_COLOUR, markersize=3.0, linewidth=1.0)
        axes.plot(left[0], ahead[0], "o", color="black", markersize=6.0)
        every = max(1, timesteps // 12)
        axes.quiver(
            left[::every],
            ahead[::every],
            [0.16 * math.sin(pose.yaw_rad) for pose in track[::every]],
            [0.16 * math.cos(pose.yaw_rad) for pose in track[::every]],
            color=HEADING_COLOUR, angles="xy", scale_units="xy", scale=1.0, width=0.008, zorder=3,
        )  # fmt: skip
        middle_x, middle_y = 0.5 * (min(left) + max(left)), 0.5 * (min(ahead) + max(ahead))
        axes.set_xlim(middle_x + 0.9, middle_x - 0.9)  # left is on the left
        axes.set_ylim(middle_y - 0.9, middle_y + 0.9)
        axes.set_aspect("equal")
        own = [text for text in texts if "phase" not in text and "parts" not in text]
        title = ", ".join(own[:2])
        axes.set_title(f"{name}, {timesteps} timesteps" + (f"\n{title}" if title else ""), fontsize=10)
        axes.grid(alpha=0.3)
        axes.tick_params(labelsize=8)
    figure.supxlabel("to the left of the start (m)")
    figure.supylabel("ahead of the start (m)")
    figure.savefig(folder / "paths.png", dpi=110)


def main() -> int:
    """Draw the picture; return 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=PICTURES)
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    draw(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
