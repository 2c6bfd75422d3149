"""Makes what README and tutorial open with: a GIF of track two, and robots on a bowl in three dimensions.

The latter are those of the simulation, coloured as in the figures, on a bowl three times as deep as the paper's.

Run: python bench/opening_pictures.py [--out FOLDER] [--only NAME]
"""

import argparse
import math
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from matplotlib.colors import to_rgba

from robot_formation.analysis.style import robot_colour
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import load_track, with_value
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.launching.processes import run_metadata
from robot_formation.names import LEADER, follower
from robot_formation.surface.bowl import Bowl
from robot_formation.viewing.animate import animate
from robot_formation.world.bullet import pybullet
from robot_formation.world.description import robot_description
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface

PICTURES = Path(__file__).parent.parent / "docs" / "pictures"
SEED = 3
WORLD = WorldParameters()
BOWL = Bowl(curvature_per_m=0.3)
SIZE = (1000, 500)
FINER = 2
"""Pixels drawn per pixel of the picture, each way: the renderer does not smooth edges."""
CELLS = 120
"""Facets per edge of the ground."""
TEXTURE_PX = 2048
TILE_M = 0.10
CONTOUR_M = 0.04
LIGHT = (1.7, 1.0, 2.4)
SHADOW = 0.5
"""Darkness of the robots' shadows, and how far their edges are blurred."""
SHADOW_BLUR_M = 0.02
POSES = {
    name: pose_on_surface(BOWL, 0.47 + number * FORMATION_DISTANCE_M, 0.50, math.radians(90.0))
    for number, name in enumerate((LEADER, follower(1), follower(2)))
}
FAR_GREY = 246


def animate_track_two(folder: Path) -> None:
    """Run track two as `formation run --in-process` does, and animate it."""
    scenario = with_value(load_track("two"), "seed", SEED)
    with tempfile.TemporaryDirectory() as temporary:
        bag = Path(temporary) / "run"
        run_in_process(scenario, bag, run_metadata(scenario))
        made = animate(bag, folder / "track_two.gif", follower(1))
    print(f"{made.path}: {made.pictures} pictures, {made.path.stat().st_size / 1e6:.2f} MB")


def draw_robots(folder: Path) -> None:
    """Draw a leader and two followers on the bowl, seen obliquely from above."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory() as temporary:
            _add_ground(Path(temporary), client)
            for name, pose in POSES.items():
                _add_robot(Path(temporary), client, name, pose)
            picture = _photograph(client)
    finally:
        pybullet.disconnect(physicsClientId=client)
    path = folder / "robots_on_bowl.jpg"
    cv2.imwrite(str(path), picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def _add_ground(folder: Path, client: int) -> None:
    """Put the bowl's plate as a mesh with a texture."""
    ticks = np.linspace(0.0, BOWL.size_m, CELLS + 1)
    xs, ys = np.meshgrid(ticks, ticks)
    zs = BOWL.heights(xs, ys)
    path = folder / "ground.obj"
    lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in zip(xs.flat, ys.flat, zs.flat, strict=True)]
    lines += [f"vt {x / BOWL.size_m:.5f} {y / BOWL.size_m:.5f}" for x, y in zip(xs.flat, ys.flat, strict=True)]
    for x, y in zip(xs.flat, ys.flat, strict=True):
        normal = BOWL.normal(float(x), float(y))
        lines.append("vn {:.5f} {:.5f} {:.5f}".format(*normal))
    row = CELLS + 1
    for first in (i * row + j + 1 for i in range(CELLS) for j in range(CELLS)):
        for corners in ((first, first + 1, first + row + 1), (first, first + row + 1, first + row)):
            lines.append("f " + " ".join(f"{n}/{n}/{n}" for n in corners))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    texture = folder / "ground.png"
    cv2.imwrite(str(texture), _texture()[::-1, :, ::-1])
    shape = pybullet.createVisualShape(
        pybullet.GEOM_MESH, fileName=str(path), specularColor=(0.0, 0.0, 0.0), physicsClientId=client
    )
    body = pybullet.createMultiBody(baseVisualShapeIndex=shape, physicsClientId=client)
    number = pybullet.loadTexture(str(texture), physicsClientId=client)
    pybullet.changeVisualShape(body, -1, textureUniqueId=number, rgbaColor=(1, 1, 1, 1), physicsClientId=client)


def _texture() -> npt.NDArray[np.uint8]:
    """Draw the plate from above, RGB with y upward in the rows: tiles, and contour lines."""
    ticks = (np.arange(TEXTURE_PX) + 0.5) / TEXTURE_PX * BOWL.size_m
    xs, ys = np.meshgrid(ticks, ticks)
    zs = BOWL.heights(xs, ys)
    tiles = (np.floor(xs / TILE_M) + np.floor(ys / TILE_M)) % 2
    shade = (zs - zs.min()) / np.ptp(zs)
    low, high = np.array((168.0, 190.0, 196.0)), np.array((236.0, 233.0, 222.0))
    colour = low + shade[..., None] * (high - low)
    colour *= np.where(tiles, 1.0, 0.93)[..., None]
    slope = np.hypot(*np.gradient(zs, ticks, ticks))
    away_m = np.abs((zs + 0.5 * CONTOUR_M) % CONTOUR_M - 0.5 * CONTOUR_M) / np.maximum(slope, 1e-3)
    line = np.clip(1.6 - away_m / 0.0025, 0.0, 1.0)[..., None]
    colour += line * (np.array((95.0, 105.0, 110.0)) - colour)
    return np.asarray(np.clip(colour * _light(), 0, 255), np.uint8)


def _light() -> npt.NDArray[np.float64]:
    """Return how much light comes to each pixel of the texture, (rows, columns, 1), full is 1: robots' shadows."""
    per_m = TEXTURE_PX / BOWL.size_m
    shade = np.zeros((TEXTURE_PX, TEXTURE_PX), np.float32)
    chassis = WORLD.chassis
    half = 0.5 * np.array((chassis.length_m, chassis.width_m))
    for pose in POSES.values():
        corners = [
            np.array(pose.place((x * half[0], y * half[1], z)))
            for x in (-1, 1)
            for y in (-1, 1)
            for z in (0.0, chassis.body_top_m)
        ]
        above = [corner[2] - BOWL.height(corner[0], corner[1]) for corner in corners]
        cast = [
            corner[:2] - height / LIGHT[2] * np.array(LIGHT[:2]) for corner, height in zip(corners, above, strict=True)
        ]
        hull = cv2.convexHull(np.array(cast, np.float32) * per_m)
        cv2.fillConvexPoly(shade, np.rint(hull).astype(np.int32), SHADOW)
    blurred = cv2.GaussianBlur(shade, (0, 0), SHADOW_BLUR_M * per_m)
    return np.asarray(1.0 - blurred[..., None], float)


def _add_robot(folder: Path, client: int, name: str, pose: Pose) -> None:
    path = folder / f"{name}.urdf"
    path.write_text(robot_description(name, WORLD, camera=name != LEADER), encoding="utf-8")
    body = pybullet.loadURDF(str(path), pose.position, pose.orientation, useFixedBase=True, physicsClientId=client)
    pybullet.changeVisualShape(body, -1, shapeIndex=0, rgbaColor=to_rgba(robot_colour(name)), physicsClientId=client)


def _photograph(client: int) -> npt.NDArray[np.uint8]:
    """Take the picture, RGB (rows, columns, 3)."""
    middle = 0.5 * BOWL.size_m
    view = pybullet.computeViewMatrix((2.35, -1.05, 1.55), (middle - 0.03, middle - 0.13, 0.25), (0.0, 0.0, 1.0))
    lens = pybullet.computeProjectionMatrixFOV(29.6, SIZE[0] / SIZE[1], 0.1, 10.0)
    width, height = (FINER * side for side in SIZE)
    found = pybullet.getCameraImage(
        width,
        height,
        view,
        lens,
        shadow=0,  # its shadows cover the whole ground, which hangs over itself at the rim
        lightDirection=LIGHT,
        lightAmbientCoeff=0.60,
        lightDiffuseCoeff=0.50,
        lightSpecularCoeff=0.05,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    pixels = np.reshape(np.asarray(found[2], np.uint8), (height, width, 4))[:, :, :3].copy()
    pixels[np.reshape(found[4], (height, width)) < 0] = FAR_GREY  # where there is nothing
    return np.asarray(cv2.resize(pixels, SIZE, interpolation=cv2.INTER_AREA), np.uint8)


DRAWN = {"track_two": animate_track_two, "robots": draw_robots}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder (default: docs/pictures)")
    parser.add_argument("--only", choices=DRAWN, help="one of them")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for name in [args.only] if args.only else DRAWN:
        DRAWN[name](args.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
