"""The overhead camera above plates of other sizes: it sees all of them, as finely as the paper's."""

import numpy as np
import pytest

from robot_formation.experiment.overhead_defaults import LARGEST_M
from robot_formation.experiment.scenario import Scenario, load_track, override
from robot_formation.vision.overhead.camera_calibration import Locator
from robot_formation.world.overhead import OverheadCamera


def scenario(size_m: float, *settings: str) -> Scenario:
    ground = f"world.surface_parameters=[size_m={size_m}, curvature_per_m=0.02]"
    return override(load_track("two"), [ground, *settings])


@pytest.mark.parametrize("size_m", [1.0, 1.78, 2.6, 4.0, LARGEST_M])
def test_the_camera_sees_the_whole_plate_and_the_tracker_knows_its_lens(size_m: float) -> None:
    found = scenario(size_m)
    surface, overhead = found.world.make_surface(), found.world.overhead
    camera = OverheadCamera(surface, found.world, 0)
    edge = (0.0, 0.5 * size_m, size_m)
    places = np.array([(x, y, surface.height(x, y) + 0.216) for x in edge for y in edge])
    pixels = camera.project(places)
    assert np.all(pixels > 0.0)
    assert np.all(pixels < [overhead.width_px - 1, overhead.height_px - 1])
    good = found.overhead_tracker.chosen()
    assert (good.focal_length_px, good.centre_x_px, good.z_m) == (
        overhead.focal_length_px,
        overhead.centre_x_px,
        overhead.z_m,
    )
    assert np.allclose(Locator(good, surface, 0.216).places(pixels)[:, :2], places[:, :2], atol=0.003)


def test_a_dot_is_as_large_above_every_larger_plate() -> None:
    sizes = [scenario(size_m).world.overhead for size_m in (1.78, 3.0, 6.0)]
    assert np.allclose([p.focal_length_px / p.z_m for p in sizes], sizes[0].focal_length_px / sizes[0].z_m)


def test_the_papers_plate_has_the_default_camera() -> None:
    assert scenario(1.78).world.overhead == load_track("two").world.overhead
    assert scenario(1.78).overhead_tracker.good == load_track("two").overhead_tracker.good


def test_above_a_plate_that_is_too_large_the_camera_is_off_unless_it_is_asked_for() -> None:
    large = 1.1 * LARGEST_M
    assert not scenario(large).world.overhead.enabled
    assert scenario(large).too_large_for_overhead
    asked = scenario(large, "world.overhead.enabled=true")
    assert asked.world.overhead.enabled
    assert not asked.too_large_for_overhead
    assert not scenario(2.0, "world.overhead.enabled=false").too_large_for_overhead


def test_who_arranges_the_camera_gets_what_they_set_and_nothing_else() -> None:
    own = scenario(4.0, "world.overhead.z_m=3.0")
    default = load_track("two")
    assert own.world.overhead.z_m == 3.0
    assert own.world.overhead.x_m == default.world.overhead.x_m
    assert own.overhead_tracker.good == default.overhead_tracker.good


def test_a_calibration_that_is_set_is_kept() -> None:
    found = scenario(4.0, "overhead_tracker.good.k1=-0.1")
    assert found.overhead_tracker.good.k1 == -0.1
    assert found.overhead_tracker.good.z_m == found.world.overhead.z_m
