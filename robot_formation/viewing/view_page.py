"""A recorded run as one page in a file: the scene as viser exports it, and beside it what the follower saw and said."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot_formation.bag.formation_bag import FormationBag
from robot_formation.json_values import JsonObject
from robot_formation.system.files import check_writable, write_whole
from robot_formation.viewing.browser import ViewError, view_server
from robot_formation.viewing.moment import FollowerNow, Picture
from robot_formation.viewing.page_template import PAGE
from robot_formation.viewing.run_moments import RunMoments
from robot_formation.viewing.show_bag import CameraPictures, set_stage
from robot_formation.viewing.stage import Stage

MOST_FRAMES = 1500
"""Instants of the scene; of longer runs fewer per simulated second are kept."""
MOST_PICTURES = 160
"""Camera pictures, of all followers together."""
MOST_BYTES = 8_000_000
_LONGEST_PLAYBACK_S = 120.0
_WIDTH_PX, _CONE_WIDTH_PX = 474, 158
_QUALITY = 65


def write_page(path: Path, bag: FormationBag, run: RunMoments, warn: Callable[[str], None]) -> int:
    """Write the page; an older file there is replaced.

    Args:
        path: the file.
        bag: the open bag.
        run: the run in it.
        warn: takes lines for people.

    Returns:
        Its size in bytes.

    Raises:
        ViewError: viser is missing, the file can't be written, or the page would be too large.
        BagError: the bag is corrupted.
    """
    try:
        check_writable(path)  # the page takes a while
        return _write_page(path, make_page(bag, run, warn).encode("utf-8"))
    except OSError as error:
        raise ViewError(f"{path} can't be written ({error.strerror or error}); choose another place") from error


def _write_page(path: Path, text: bytes) -> int:
    if len(text) > MOST_BYTES:
        raise ViewError(
            f"the page would have {len(text) / 1e6:.1f} MB, more than {MOST_BYTES / 1e6:g} MB; nothing was written"
        )
    write_whole(path, text)
    return len(text)


def make_page(bag: FormationBag, run: RunMoments, warn: Callable[[str], None]) -> str:
    """Return the page's text; see `write_page`."""
    pictures = CameraPictures(bag, warn)
    followers = [follower.name for follower in run.record.followers]
    share = MOST_PICTURES // len(followers)
    shown = {name: _pictures(run, name, pictures, share) for name in followers}
    scale = max(1.0, run.duration_ns * 1e-9 / _LONGEST_PLAYBACK_S)  # simulated seconds per second of the playback
    data: JsonObject = {
        "scale": scale,
        "timesteps": run.record.timesteps_planned,
        "rendered": any(pictures.rendered(name) for name in followers),
        "followers": {name: _told(run, number, shown[name]) for number, name in enumerate(followers)},
    }
    # A "</script>" in a text of the bag must not end the page's script.
    told = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    parts = {
        "TITLE": html.escape(run.title),
        "OUTCOME": html.escape(run.analysis.outcome.replace("_", " ")),
        "SCENE": html.escape(_scene(run, shown, scale)),
        "DATA": told,
    }
    return re.sub("@([A-Z]+)@", lambda match: parts[match[1]], PAGE)


def _scene(run: RunMoments, shown: dict[str, list[tuple[int, Picture]]], scale: float) -> str:
    """Return viser's page of the whole run."""
    with view_server(0, run.title) as server:
        stage = Stage(server)
        set_stage(run, stage)
        recording = server.get_scene_serializer()
        waiting = {name: list(found) for name, found in shown.items()}
        before_ns = run.start_ns
        for stamp_ns in run.instants(MOST_FRAMES):
            recording.insert_sleep((stamp_ns - before_ns) * 1e-9 / scale)
            before_ns = stamp_ns
            stage.show(run.at(stamp_ns))
            for name, found in waiting.items():
                while found and found[0][0] <= stamp_ns:
                    stage.picture(name, _sized(found.pop(0)[1], _CONE_WIDTH_PX))
        text: Any = recording.as_html()
    return str(text)


def _pictures(run: RunMoments, robot: str, pictures: CameraPictures, most: int) -> list[tuple[int, Picture]]:
    """Choose what a follower's camera saw at the end of looks and moves: (simulated time, picture), in order."""
    follower = next(found for found in run.record.followers if found.name == robot)
    stamps = sorted({run.start_ns, *follower.state_stamps_ns, *(move.stamp_ns for move in follower.moved)})
    numbers = np.unique(np.linspace(0, len(stamps) - 1, min(most, len(stamps))).round().astype(int))
    found = ((stamps[number], pictures.at(robot, stamps[number])) for number in numbers.tolist())
    return [(stamp_ns, picture) for stamp_ns, picture in found if picture is not None]


def _told(run: RunMoments, number: int, pictures: Sequence[tuple[int, Picture]]) -> JsonObject:
    """Return what the page says of a follower, by seconds since the run's start."""
    follower = run.record.followers[number]

    def second(stamp_ns: int) -> float:
        return round((stamp_ns - run.start_ns) * 1e-9, 3)

    states = zip(follower.state_stamps_ns, follower.states, strict=False)
    return {
        "states": [[second(stamp), FollowerNow(text).words] for stamp, text in states],
        "ends": [second(displacement.stamp_ns) for displacement in follower.displacements],
        "figures": [
            [figure.t, _centimetres(figure.correction_m), _centimetres(figure.error_m)]
            for figure in run.figures[follower.name]
        ],
        "pictures": [[second(stamp), _jpeg(_sized(picture, _WIDTH_PX))] for stamp, picture in pictures],
    }


def _centimetres(value_m: float | None) -> float | None:
    return None if value_m is None else round(100.0 * value_m, 3)


def _sized(picture: Picture, width_px: int) -> Picture:
    height = round(picture.shape[0] * width_px / picture.shape[1])
    return np.asarray(cv2.resize(picture, (width_px, height), interpolation=cv2.INTER_AREA), np.uint8)


def _jpeg(picture: Picture) -> str:
    encoded = cv2.imencode(".jpg", np.ascontiguousarray(picture[:, :, ::-1]), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    return base64.b64encode(encoded.tobytes()).decode("ascii")
