"""The controls and figures beside the scene, as a panel of viser."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from robot_formation.viewing.moment import FollowerNow, Moment, Picture, TimestepFigures, figures_in_words

Action = Callable[[], None]

_PICTURE_QUALITY = 80
_ERROR_STROKE, _CORRECTION_STROKE = "#0072b2", "#d55e00"


def plain(text: str) -> str:
    """Escape a text for viser's Markdown, which also takes HTML: words of a bag or of other nodes may hold anything."""
    return re.sub(r"([\\`*_{}\[\]()#+.!|~<>&:@$=-])", r"\\\1", " ".join(text.split()))


class Panel:
    """Says what a follower does, shows what its camera saw, and plots its errors and corrections.

    What people click arrives on threads of the server. It waits here until `act` is called.

    Args:
        server: viser's ViserServer.
        followers: their names; people choose one if there are several.
        timesteps: of the run, for the plot; None if that isn't known.

    Attributes:
        follower: the chosen one.
    """

    def __init__(self, server: Any, followers: Sequence[str], timesteps: int | None = None) -> None:
        self._server, self._gui = server, server.gui
        self._actions: SimpleQueue[Action] = SimpleQueue()
        self._timesteps = timesteps
        self._told, self._figures = "", 0
        self.follower = followers[0]
        if len(followers) > 1:
            choice = self._gui.add_dropdown("follower", tuple(followers))
            choice.on_update(self._queued(lambda: self._choose(str(choice.value))))
        self._words = self._gui.add_markdown("waiting for the robots ...")
        self._picture: Any = None
        self._plot: Any = None

    def button(self, label: str, action: Action) -> Any:
        """Add a button; return viser's handle."""
        handle = self._gui.add_button(label)
        handle.on_click(self._queued(action))
        return handle

    def choice(self, label: str, options: Sequence[str], first: str, chosen: Callable[[str], None]) -> Any:
        """Add a choice among texts; return viser's handle."""
        handle = self._gui.add_dropdown(label, tuple(options), initial_value=first)
        handle.on_update(self._queued(lambda: chosen(str(handle.value))))
        return handle

    def slider(self, label: str, most: float, moved: Callable[[float], None]) -> Any:
        """Add a slider from 0; `moved` hears of people's moves only. Return viser's handle."""
        handle = self._gui.add_slider(label, 0.0, max(most, 0.1), 0.1, 0.0)

        @handle.on_update  # type: ignore[untyped-decorator, unused-ignore]
        def _(event: Any) -> None:
            if event.client is not None:
                value = float(handle.value)
                self._actions.put(lambda: moved(value))

        return handle

    def act(self) -> None:
        """Do what people have asked for since the last time."""
        while True:
            try:
                action = self._actions.get_nowait()
            except Empty:
                return
            action()

    def tell(self, moment: Moment, timesteps: int | None, remark: str, figures: Sequence[TimestepFigures]) -> None:
        """Say what is the case.

        Args:
            moment: now.
            timesteps: of the run, if that is known.
            remark: what else there is to say, may be empty.
            figures: the chosen follower's finished timesteps until now.
        """
        now = moment.followers.get(self.follower, FollowerNow())
        finished = f"{now.finished} of {timesteps}" if timesteps else str(now.finished)
        lines = [
            f"**{plain(self.follower.replace('_', ' '))}** {plain(now.words)}",
            f"{moment.stamp_ns * 1e-9:.2f} s simulated, {finished} timesteps finished",
            plain(figures_in_words(figures)),
            plain(remark),
        ]
        text = "\n\n".join(line for line in lines if line)
        if text != self._told:
            self._words.content = self._told = text
        if len(figures) != self._figures:
            self._figures = len(figures)
            self._draw(figures)

    def picture(self, picture: Picture) -> None:
        """Show what the chosen follower's camera saw."""
        if self._picture is None:
            self._picture = self._gui.add_image(
                picture, label="what the camera saw, with blocks", format="jpeg", jpeg_quality=_PICTURE_QUALITY
            )
        else:
            self._picture.image = picture

    def _choose(self, follower: str) -> None:
        """Show another follower: what the last one saw and did is gone until there is something of this one."""
        self.follower, self._figures = follower, 0
        for shown in (self._picture, self._plot):
            if shown is not None:
                shown.remove()
        self._picture = self._plot = None

    def _queued(self, action: Action) -> Callable[[Any], None]:
        return lambda event: self._actions.put(action)

    def _draw(self, figures: Sequence[TimestepFigures]) -> None:
        unknown = float("nan")
        columns = [
            np.array([f.t for f in figures], float),
            np.array([100.0 * (unknown if f.error_m is None else f.error_m) for f in figures]),
            np.array([100.0 * (unknown if f.correction_m is None else f.correction_m) for f in figures]),
        ]
        data = tuple(columns)
        if self._plot is not None:
            self._plot.data = data
            return
        last = float(self._timesteps or 0)
        self._plot = self._gui.add_uplot(
            data,
            (
                {"label": "timestep"},
                {"label": "formation error (cm)", "stroke": _ERROR_STROKE, "width": 2, "points": {"show": True}},
                {"label": "correction (cm)", "stroke": _CORRECTION_STROKE, "width": 2, "points": {"show": True}},
            ),
            scales={"x": {"time": False, **({"range": (0.0, last + 1.0)} if last else {})}, "y": {}},
            axes=({"label": "timestep"}, {"label": "cm"}),
            aspect=1.4,
        )
