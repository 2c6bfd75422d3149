"""Animations as files: GIF by Pillow, MP4 by the program ffmpeg, and single pictures as PNG."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from robot_formation.errors import FormationError
from robot_formation.system.files import unfinished_file
from robot_formation.viewing.gif_palette import Palette

Picture = NDArray[np.uint8]
"""RGB, (rows, columns, 3)."""

SUFFIXES = (".gif", ".mp4", ".png")
_LAST_MS = 2000
"""How long a GIF shows its last picture before it begins again."""


class AnimationError(FormationError):
    """An animation can't be made or written; the text says why."""


def check_format(path: Path) -> None:
    """Check that a file of this name can be made.

    Raises:
        AnimationError: its ending is unknown, or ffmpeg is needed and missing.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise AnimationError(f"'{path.name}' is no animation: end its name with {', '.join(SUFFIXES)}")
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise AnimationError(f"{path}: an MP4 needs the program ffmpeg, which is not installed; write a .gif instead")


def write_gif(path: Path, pictures: Iterable[Picture], palette_of: Sequence[Picture], fps: float) -> None:
    """Write an animation that goes on for ever; an older file there is replaced.

    Args:
        path: the file.
        pictures: all of one size.
        palette_of: some of them, whose colours are the file's.
        fps: pictures per second; GIF counts in hundredths of a second.

    Raises:
        AnimationError: the file can't be written.
    """
    # One palette and no dithering: what doesn't move is the same in all pictures, and costs nothing.
    palette = Palette(np.vstack(list(palette_of)))
    first, *others = (palette.image(picture) for picture in pictures)
    shown_ms = max(2, round(100.0 / fps)) * 10
    with _unfinished(path) as unfinished:
        first.save(
            unfinished,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=[*[shown_ms] * len(others), _LAST_MS],
            loop=0,
            optimize=True,  # what stays the same becomes transparent: a quarter of the bytes
        )
        unfinished.replace(path)


def write_png(path: Path, picture: Picture) -> None:
    """Write one picture; an older file there is replaced.

    Raises:
        AnimationError: the file can't be written.
    """
    with _unfinished(path) as unfinished:
        Image.fromarray(picture).save(unfinished, format="PNG", optimize=True)
        unfinished.replace(path)


def write_mp4(path: Path, pictures: Iterable[Picture], size: tuple[int, int], fps: float) -> None:
    """Write a film (H.264) by ffmpeg; an older file there is replaced.

    Args:
        path: the file.
        pictures: all of one size.
        size: their width and height, pixels, both even.
        fps: pictures per second.

    Raises:
        AnimationError: ffmpeg is missing or fails, or the file can't be written.
    """
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{fps:g}", "-i", "-"]
    target = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart", "-f", "mp4"]
    with _unfinished(path) as unfinished, tempfile.TemporaryFile() as said:
        # In a session of its own, so that Ctrl-C doesn't end it before it is stopped here.
        try:
            process = subprocess.Popen(
                ["ffmpeg", "-y", "-loglevel", "error", *source, *target, str(unfinished)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=said,
                start_new_session=True,
            )
        except OSError as error:
            raise AnimationError(f"ffmpeg can't be started: {error.strerror}; write a .gif instead") from error
        try:
            _feed(process, pictures)
        finally:
            _end(process)
        if process.returncode:
            said.seek(0)
            lines = said.read(4096).decode(errors="replace").split("\n")
            reason = next((line.strip() for line in lines if line.strip()), f"exit code {process.returncode}")
            raise AnimationError(f"ffmpeg can't write {path}: {reason}; write a .gif instead")
        unfinished.replace(path)


def _feed(process: subprocess.Popen[bytes], pictures: Iterable[Picture]) -> None:
    """Give a process the pictures and wait for its end; one that ends too early is found by its exit code."""
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):
        for picture in pictures:
            process.stdin.write(np.ascontiguousarray(picture).tobytes())
        process.stdin.close()
    process.wait()


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process that is still at work, and close what leads to it."""
    if process.poll() is None:
        process.kill()
        process.wait()
    if process.stdin is not None:
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()


@contextlib.contextmanager
def _unfinished(path: Path) -> Iterator[Path]:
    """Make a file beside the one that is to be: see `unfinished_file`.

    Raises:
        AnimationError: it can't be written.
    """
    try:
        with unfinished_file(path) as unfinished:
            yield unfinished
    except OSError as error:
        raise AnimationError(f"{path} can't be written: {error.strerror or error}; choose another folder") from error
