"""A recorded run in a browser, for as long as people look at it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from robot_formation.bag.formation_bag import FormationBag
from robot_formation.errors import FormationError
from robot_formation.viewing.moment import Picture
from robot_formation.viewing.panel import Panel
from robot_formation.viewing.playback import Playback
from robot_formation.viewing.run_moments import RunMoments
from robot_formation.viewing.stage import Stage
from robot_formation.vision.pixy2.block_drawing import drawn

if TYPE_CHECKING:
    from robot_formation.viewing.replayed_camera import ReplayedCamera

PERIOD_S = 0.05
"""Browsers get what has changed so often."""
_PICTURE_PERIOD_S = 0.2
SPEEDS = ("0.25", "0.5", "1", "2", "4", "8", "16")


def set_stage(run: RunMoments, stage: Stage) -> None:
    """Draw what stands still in a run, and its robots at its start."""
    if run.record.ground is not None:
        stage.ground(run.record.ground)
    else:
        stage.look_at(run.path(run.robots[0]))
    for robot in run.robots:
        stage.robot(robot, run.shapes[robot])
        stage.path(robot, run.path(robot))
        if robot in run.lenses:
            stage.camera(robot, run.lenses[robot])
    stage.show(run.at(run.start_ns))


class CameraPictures:
    """Pictures of followers' cameras with the blocks that were found in them, as far as the bag lets them be made.

    Args:
        bag: the open bag.
        warn: takes a line if there can be no pictures of a follower.
    """

    def __init__(self, bag: FormationBag, warn: Callable[[str], None]) -> None:
        self._bag, self._warn = bag, warn
        self._cameras: dict[str, ReplayedCamera | None] = {}

    def at(self, robot: str, stamp_ns: int) -> Picture | None:
        """Return the picture of an instant, if there is one."""
        if robot not in self._cameras:
            # Imports the world's parts, which the scene doesn't wait for.
            from robot_formation.viewing.replayed_camera import ReplayedCamera

            try:
                self._cameras[robot] = ReplayedCamera(self._bag, robot)
            except FormationError as error:
                self._cameras[robot] = None
                self._warn(f"no camera pictures: {error}")
        camera = self._cameras[robot]
        if camera is None:
            return None
        view = camera.view(stamp_ns)
        return drawn(view.picture, view.blocks)

    def rendered(self, robot: str) -> bool:
        """Return whether a follower's pictures are rendered, since the bag has none."""
        camera = self._cameras.get(robot)
        return camera is not None and camera.rendered


class BagShow:
    """Plays a run to browsers.

    Args:
        server: viser's ViserServer.
        bag: the open bag.
        run: the run in it.
        warn: takes lines for people.
    """

    def __init__(self, server: Any, bag: FormationBag, run: RunMoments, warn: Callable[[str], None]) -> None:
        self._run, self._stage = run, Stage(server)
        set_stage(run, self._stage)
        followers = [follower.name for follower in run.record.followers]
        self._panel = Panel(server, followers, run.record.timesteps_planned)
        ends = [d.stamp_ns for follower in run.record.followers for d in follower.displacements]
        self._playback = Playback(run.start_ns, run.end_ns, ends)
        self._pictures = CameraPictures(bag, warn)
        self._picture_of: tuple[str, int] | None = None
        self._slider_s = 0.0
        self._pause = self._panel.button("pause", self._toggle)
        self._panel.button("next timestep", self._playback.step)
        self._panel.choice("speed (times real time)", SPEEDS, "1", self._set_speed)
        self._slider = self._panel.slider("time (s)", self._playback.duration_s, self._playback.seek)

    def run(self, stopped: Callable[[], bool]) -> None:
        """Play until `stopped` says so."""
        before = time.monotonic()
        pictured = before
        while not stopped():
            time.sleep(max(0.0, before + PERIOD_S - time.monotonic()))
            now = time.monotonic()
            self._panel.act()
            self._playback.elapse(now - before)
            before = now
            self.show()
            if now - pictured >= _PICTURE_PERIOD_S:
                self._show_picture()
                pictured = time.monotonic()

    def show(self) -> None:
        """Show the instant at which the playback is."""
        playback = self._playback
        moment = self._run.at(playback.now_ns)
        self._stage.show(moment)
        follower = self._panel.follower
        finished = moment.followers[follower].finished
        remark = "the camera's picture is rendered from ground truth" if self._pictures.rendered(follower) else ""
        figures = self._run.figures[follower][:finished]
        self._panel.tell(moment, self._run.record.timesteps_planned, remark, figures)
        label = "pause" if playback.playing else "play"
        if self._pause.label != label:
            self._pause.label = label
        if abs(playback.now_s - self._slider_s) >= 0.1 or (not playback.playing and playback.now_s != self._slider_s):
            self._slider_s = playback.now_s
            self._slider.value = round(playback.now_s, 1)

    def _show_picture(self) -> None:
        wanted = (self._panel.follower, self._playback.now_ns)
        if wanted != self._picture_of:
            self._picture_of = wanted
            picture = self._pictures.at(*wanted)
            if picture is not None:
                self._panel.picture(picture)
                self._stage.picture(wanted[0], picture)

    def _toggle(self) -> None:
        self._playback.playing = not self._playback.playing

    def _set_speed(self, text: str) -> None:
        self._playback.speed = float(text)
