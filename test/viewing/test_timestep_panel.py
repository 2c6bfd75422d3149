"""Bars of timesteps."""

from types import SimpleNamespace
from typing import cast

from robot_formation.analysis.plotting import new_figure
from robot_formation.viewing.recorded_scene import CorrectionSums, RecordedScene
from robot_formation.viewing.timestep_panel import TimestepPanel


def test_a_bag_that_plans_any_number_of_timesteps_has_bars_of_those_begun() -> None:
    scene = SimpleNamespace(
        timesteps=999_999_999,
        timesteps_with_moves=3,
        end_ns=10,
        corrections=lambda t, stamp_ns: CorrectionSums(0.01 * t, 0.02),
        error_m=lambda t, stamp_ns: 0.005,
        finished=lambda stamp_ns: 2,
    )
    axes = new_figure(4.0, 3.0).subplots()
    panel = TimestepPanel(axes, cast(RecordedScene, scene))
    panel.update(5)
    axes.figure.canvas.draw()
    assert axes.get_xlim() == (0.5, 999_999_999.5)
    assert len(panel.artists) == 2 * 3 + 1
    assert [round(patch.get_height(), 9) for patch in axes.containers[1]] == [1.0, 2.0, 3.0]
