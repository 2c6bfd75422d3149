"""An animation of a recorded run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_formation.analysis.report import made_folder, pictures_folder
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.reader import read_bag
from robot_formation.system.files import check_writable
from robot_formation.viewing.animation_figure import AnimationFigure
from robot_formation.viewing.animation_file import (
    AnimationError,
    Picture,
    check_format,
    write_gif,
    write_mp4,
    write_png,
)
from robot_formation.viewing.recorded_scene import RecordedScene
from robot_formation.viewing.replayed_camera import ReplayedCamera

MOST_PICTURES = 2000
_USUAL_PICTURES = 150
_PALETTE_PICTURES = 6


@dataclass(frozen=True)
class Animation:
    """What was written.

    Attributes:
        path: the file.
        pictures: how many there are in it.
        size: width and height, pixels.
        every_s: simulated seconds from one picture to the next.
        rendered: whether the camera's pictures were rendered from ground truth; else the bag has them.
        known_world: whether the bag tells what they are rendered by; else the defaults were taken.
    """

    path: Path
    pictures: int
    size: tuple[int, int]
    every_s: float
    rendered: bool
    known_world: bool


def picture_stamps(start_ns: int, end_ns: int, every_s: float | None) -> list[int]:
    """List the times of the pictures, nanoseconds: from the start in even steps, and the end.

    Args:
        start_ns: of the run.
        end_ns: of the run.
        every_s: the step; None for one that gives up to some 150 pictures, in tenths of a second.

    Raises:
        AnimationError: there would be too many.
    """
    if every_s is None:
        every_s = max(1, math.ceil((end_ns - start_ns) * 1e-8 / _USUAL_PICTURES)) / 10
    count = (end_ns - start_ns) / (every_s * 1e9) + 1.0
    if count > MOST_PICTURES:
        raise AnimationError(
            f"a picture every {every_s:g} s makes {count:.0f} of them; at most {MOST_PICTURES} are possible: "
            f"give --every {math.ceil((end_ns - start_ns) * 1e-8 / MOST_PICTURES) / 10:g} or more"
        )
    return [*range(start_ns, end_ns, max(1, round(every_s * 1e9))), end_ns]


def animate(
    bag: Path,
    out: Path | None,
    follower: str,
    *,
    namespace: str | None = None,
    fps: float = 10.0,
    every_s: float | None = None,
    width_px: int = 800,
    progress: Callable[[Iterable[Picture], int], Iterable[Picture]] = lambda pictures, count: pictures,
) -> Animation:
    """Draw a run and write it: an animation (.gif, .mp4), or a picture of its end (.png).

    Args:
        bag: of the run.
        out: file to write; an older one there is replaced. None: animation.gif in the folder of the bag's pictures.
        follower: whose camera, place and corrections are shown.
        namespace: where the formation lies in the bag, '/' for the root; None: wherever there is one.
        fps: pictures per second of the animation.
        every_s: simulated seconds from one picture to the next; see `picture_stamps`.
        width_px: width of the pictures, made even; the height goes with it.
        progress: passes pictures on, of which there are so many, and tells how far it is.

    Raises:
        FormationError: the bag has no such run or no ground truth, or the file can't be written.
    """
    if out is not None:
        check_format(out)
    with read_bag(bag) as opened:
        of_formation = FormationBag(opened, namespace)
        scene, camera = RecordedScene(of_formation, follower), ReplayedCamera(of_formation, follower)
        stamps = picture_stamps(scene.start_ns, scene.end_ns, every_s)
        out = out or made_folder(pictures_folder(bag)) / "animation.gif"
        try:
            check_writable(out)  # drawing takes a while
        except OSError as error:
            raise AnimationError(f"{out} can't be written: {error.strerror or error}; choose another place") from error
        figure = AnimationFigure(scene, camera, width_px + width_px % 2)
        if out.suffix.lower() == ".png":
            stamps = stamps[-1:]
            write_png(out, figure.picture(scene.end_ns))
        else:
            pictures = progress((figure.picture(stamp_ns) for stamp_ns in stamps), len(stamps))
            if out.suffix.lower() == ".mp4":
                write_mp4(out, pictures, figure.size, fps)
            else:
                chosen = np.linspace(0, len(stamps) - 1, _PALETTE_PICTURES).astype(int)
                write_gif(out, pictures, [figure.picture(stamps[number]) for number in chosen], fps)
        step_s = (stamps[1] - stamps[0]) * 1e-9 if len(stamps) > 1 else 0.0
        return Animation(out, len(stamps), figure.size, step_s, camera.rendered, camera.known_world)
