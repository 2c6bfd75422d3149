"""A recorded run as one picture per time: from above, the camera's picture, the place, the timesteps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.figures import run_title
from robot_formation.analysis.style import robot_colour, styled
from robot_formation.viewing.camera_panel import CameraPanel
from robot_formation.viewing.place_panel import PlacePanel
from robot_formation.viewing.plan_panel import FORECAST_COLOUR, PLACE_COLOUR, VIEW_COLOUR, PlanPanel
from robot_formation.viewing.recorded_scene import RecordedScene
from robot_formation.viewing.replayed_camera import ReplayedCamera
from robot_formation.viewing.timestep_panel import TimestepPanel

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

WIDTH_IN, HEIGHT_IN = 8.0, 6.8
_NS = 1e-9


class AnimationFigure:
    """Draws pictures of a run; only what changes is drawn anew for each.

    Attributes:
        size: width and height of the pictures, pixels.
    """

    @styled
    def __init__(self, scene: RecordedScene, camera: ReplayedCamera, width_px: int) -> None:
        """Lay out the panels.

        Args:
            scene: the run.
            camera: that of the follower that is looked at.
            width_px: width of the pictures; even, as films need it.
        """
        from matplotlib.figure import Figure

        self._scene, self._camera = scene, camera
        self.size = width_px, 2 * round(width_px * HEIGHT_IN / WIDTH_IN / 2)
        figure = Figure(figsize=(WIDTH_IN, self.size[1] * WIDTH_IN / width_px), dpi=width_px / WIDTH_IN)
        self._canvas = _canvas(figure)
        follower = scene.follower.replace("_", " ")
        plan, view = _axes(figure, (0.075, 0.425, 0.445, 0.53)), _axes(figure, (0.545, 0.60, 0.435, 0.335))
        steps, place = _axes(figure, (0.075, 0.085, 0.56, 0.24)), _axes(figure, (0.72, 0.085, 0.265, 0.265))
        figure.text(0.012, 0.972, run_title(scene.record, scene.analysis), fontsize=11, fontweight="bold", va="center")
        source = "rendered from ground truth" if camera.rendered else "as recorded"
        view.set_title(f"{follower}'s camera, {source}", loc="left", fontsize=9)
        place.set_title(f"{follower} from its place", loc="left", fontsize=9)
        steps.set_title("each timestep", loc="left", fontsize=9)
        self._words = figure.text(0.548, 0.575, "", fontsize=9.5, va="top", linespacing=1.45, animated=True)
        self._panels = (
            PlanPanel(plan, scene),
            CameraPanel(view, camera, scene.start_ns),
            TimestepPanel(steps, scene),
            PlacePanel(place, scene),
        )
        handles = steps.get_legend_handles_labels()[0]
        steps.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=3, borderaxespad=0.1,
                     fontsize=8.5, handlelength=1.4, columnspacing=1.0)  # fmt: skip
        figure.legend(handles=_legend(scene), loc="upper left", bbox_to_anchor=(0.54, 0.50), ncols=2, fontsize=8.5,
                      handlelength=1.5, columnspacing=1.2, borderaxespad=0.0)  # fmt: skip
        artists: list[Artist] = [artist for panel in self._panels for artist in panel.artists]
        self._artists = [*artists, self._words]
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)

    def picture(self, stamp_ns: int) -> NDArray[np.uint8]:
        """Draw a time of the run, nanoseconds; return RGB (rows, columns, 3)."""
        for panel in self._panels:
            panel.update(stamp_ns)
        self._words.set_text(self._text(stamp_ns))
        self._canvas.restore_region(self._background)
        for artist in self._artists:
            artist.draw(self._canvas.get_renderer())
        return np.array(self._canvas.buffer_rgba())[:, :, :3]

    def _text(self, stamp_ns: int) -> str:
        scene = self._scene
        looks = bool(self._camera.view(stamp_ns).blocks)
        timestep = min(scene.finished(stamp_ns) + 1, scene.timesteps)
        return "\n".join(
            (
                f"timestep {timestep} of {scene.timesteps}     {(stamp_ns - scene.start_ns) * _NS:.2f} s",
                scene.words(stamp_ns, looks=looks),
            )
        )


def _canvas(figure: Figure) -> Any:
    """Make what the figure is drawn on; matplotlib tells no types of it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    return FigureCanvasAgg(figure)


def _axes(figure: Figure, place: tuple[float, float, float, float]) -> Any:
    return figure.add_axes(place)


def _legend(scene: RecordedScene) -> list[Any]:
    """Handles of what the plan shows."""
    from matplotlib.patches import Patch

    robots = [
        Patch(facecolor=robot_colour(robot), edgecolor="black", alpha=0.55, label=robot.replace("_", " "))
        for robot in scene.robots
    ]
    return [
        *robots,
        Patch(fill=False, edgecolor=PLACE_COLOUR, linestyle=(0, (3, 1.5)), label="place in formation"),
        Patch(facecolor=FORECAST_COLOUR, label="forecast, 90 % ellipse"),
        Patch(facecolor=VIEW_COLOUR, alpha=0.5, label="camera's view"),
    ]
