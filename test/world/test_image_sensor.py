"""Exposure, flicker, white balance and noise of the cameras, each against a formula or what its name promises."""

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import case
from robot_formation.parameters import ParameterError
from robot_formation.surface import make_surface
from robot_formation.vision.luminance import LUMINANCE_WEIGHTS
from robot_formation.world.camera import Camera
from robot_formation.world.events import Frame
from robot_formation.world.exposure import MAX_GAIN, READOUT_S, exposure_of
from robot_formation.world.pose import pose_on_surface
from robot_formation.world.scene import FULL
from robot_formation.world.sensor import Sensor
from world_helpers import of_kind, parameters, run, world

PLANE = make_surface("plane")
SHAPE = (208, 316, 3)


def sensor(*, seed: int = 1, **camera: Any) -> Sensor:
    return Sensor(parameters(camera=camera).camera, seed, "follower_1")


def flat(light: float | tuple[float, float, float], shape: tuple[int, int, int] = SHAPE) -> npt.NDArray[np.uint16]:
    """A picture of one linear light, grey or (red, green, blue), full scale 1."""
    return np.broadcast_to(np.rint(np.array(light, float) * FULL), shape).astype(np.uint16)


def scene(distance: float = 0.32, ahead: float = 0.0, *, near: bool = True) -> npt.NDArray[np.uint16]:
    camera = Camera(PLANE, parameters())
    seen = [pose_on_surface(PLANE, 0.9 + ahead, 0.4 + distance, 0.0)] if near else []
    return camera.light(pose_on_surface(PLANE, 0.9, 0.4, 0.0), seen)


def luma(picture: npt.NDArray[np.float32] | npt.NDArray[np.uint8]) -> float:
    return float((picture @ LUMINANCE_WEIGHTS).mean())


# --- auto exposure ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("brightness", [25, 50, 100, 150])
@pytest.mark.parametrize("view", [(0.25, 0.0), (0.32, 0.0), (0.32, 0.1), (0.7, -0.1)])
def test_the_mean_level_is_the_camera_brightness(view: tuple[float, float], brightness: int) -> None:
    found = luma(sensor(camera_brightness=brightness, flicker_avoidance=False).develop(scene(*view)).picture)
    assert found == pytest.approx(brightness, abs=2.0)


@given(
    seed=st.integers(0, 2**32 - 1),
    brightness=st.integers(20, 240),
    lux=st.floats(1.0, 5000.0),
    power=st.floats(0.2, 3.0),
)
@settings(max_examples=30, deadline=None)
def test_the_mean_level_of_any_picture_is_the_camera_brightness_or_as_near_as_it_gets(
    seed: int, brightness: int, lux: float, power: float
) -> None:
    # Blocks of the size of the sampling grid, so that what is sampled is the whole picture.
    blocks = 0.05 + 0.9 * np.random.default_rng(seed).random((4, 6, 3)) ** power
    light = np.rint(blocks.repeat(4, axis=0).repeat(4, axis=1) * FULL).astype(np.uint16)
    one = sensor(height_px=16, width_px=24, camera_brightness=brightness, illuminance_lux=lux, flicker_avoidance=False)
    development = one.develop(light)
    level = luma(np.minimum(development.levels, 255.0))
    if development.exposure == exposure_of(math.inf, one.parameters):
        assert level < brightness + 0.1
    else:
        assert level == pytest.approx(brightness, abs=0.1)


def test_twice_the_camera_brightness_is_twice_the_level() -> None:
    dim, bright = (
        luma(sensor(camera_brightness=b, flicker_avoidance=False).develop(scene()).picture) for b in (50, 100)
    )
    assert bright / dim == pytest.approx(2.0, rel=0.03)


def test_exposure_time_comes_first_and_gain_when_the_frame_is_over() -> None:
    for lux, time_s in ((500.0, None), (50.0, 1.0 / 30.0), (0.01, 1.0 / 30.0)):
        exposure = sensor(illuminance_lux=lux, flicker_avoidance=False).develop(scene()).exposure
        assert exposure.gain == 1.0 if time_s is None else exposure.time_s == time_s
        assert 1.0 <= exposure.gain <= MAX_GAIN
    assert exposure.gain == MAX_GAIN


def test_a_lower_frame_rate_allows_a_longer_exposure() -> None:
    times = [
        sensor(illuminance_lux=20.0, min_frames_per_second=rate, flicker_avoidance=False)
        .develop(scene())
        .exposure.time_s
        for rate in (60, 30, 10)
    ]
    assert times == pytest.approx([1 / 60, 1 / 30, 1 / 10])


def test_under_500_lux_a_white_wall_saturates_between_a_hundredth_and_a_fiftieth_of_a_second() -> None:
    found = sensor(camera_brightness=255, flicker_avoidance=False).develop(flat(1.0))
    assert found.levels.min() >= 254.9
    assert found.exposure.gain == 1.0
    assert 0.01 < found.exposure.time_s < 0.02


@pytest.mark.parametrize("mains", [50, 60])
@pytest.mark.parametrize("lux", [1.0, 100.0, 500.0, 1500.0])
def test_flicker_avoidance_exposes_for_whole_periods_of_the_light(mains: int, lux: float) -> None:
    exposure = sensor(mains_hz=mains, illuminance_lux=lux).develop(scene()).exposure
    periods = exposure.time_s * 2 * mains
    assert periods >= 1.0
    assert periods == pytest.approx(round(periods), abs=1e-9)
    assert exposure.time_s <= 1 / 30 + 1e-12


def test_flicker_avoidance_over_exposes_in_bright_light() -> None:
    bright: dict[str, Any] = {"illuminance_lux": 5000.0}
    assert luma(sensor(**bright).develop(scene()).picture) > 150
    assert luma(sensor(flicker_avoidance=False, **bright).develop(scene()).picture) == pytest.approx(100.0, abs=2.0)


def test_without_auto_exposure_the_first_picture_sets_it() -> None:
    fixed = sensor(auto_exposure_correction=False)
    first = fixed.develop(scene())
    dark = flat(0.05)
    assert fixed.develop(dark).exposure == first.exposure
    assert luma(fixed.develop(dark).picture) < 60
    assert luma(sensor().develop(dark).picture) == pytest.approx(100.0, abs=2.0)


# --- noise ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("lux", "gain"), [(500.0, 1.0), (10.0, None)])
def test_noise_has_the_formulas_variance_at_any_gain(lux: float, gain: float | None) -> None:
    one = sensor(illuminance_lux=lux, flicker_avoidance=False, mains_flicker=0.0)
    development = one.develop(flat(0.5))
    first, second = (one.expose(development, 0.0).astype(float) for _ in range(2))
    used = development.exposure.gain
    assert used == gain if gain else used > 4.0
    signal = (100.0 / 255.0) ** 1.5
    variance = 2.0e-4 * used * signal + (2.9e-4 * used) ** 2
    expected = 255.0 / 1.5 * signal ** (1.0 / 1.5 - 1.0) * math.sqrt(variance)
    rounding = 1 / 12
    assert first.mean() == pytest.approx(100.0, abs=0.5)
    assert first.std() == pytest.approx(math.sqrt(expected**2 + rounding), rel=0.03)
    assert np.corrcoef(first.ravel(), second.ravel())[0, 1] == pytest.approx(0.0, abs=0.02)


def test_white_balance_amplifies_the_noise_of_a_weak_colour() -> None:
    one = sensor(light_colour_rgb=[200, 200, 80])
    development = one.develop(flat(0.5))
    red, green, blue = one.expose(development, 0.0).reshape(-1, 3).std(axis=0)
    assert development.balance == pytest.approx((1.0, 1.0, 2.5), rel=1e-3)
    assert red == pytest.approx(green, rel=0.03)
    # Photons are fewer by the factor 2.5, so that the same signal varies by its root.
    assert blue / green == pytest.approx(math.sqrt(2.5), rel=0.04)


def test_a_saturated_picture_has_no_noise() -> None:
    one = sensor(illuminance_lux=20000.0)
    assert (one.expose(one.develop(flat(0.9)), 0.0) == 255).all()


# --- flicker ----------------------------------------------------------------------------------------------------------


def rows(one: Sensor, light: npt.NDArray[np.uint16], time_s: float) -> npt.NDArray[np.float64]:
    """Level of each row, noise averaged."""
    levels: npt.NDArray[np.float64] = one.expose(one.develop(light), time_s).mean(axis=(1, 2))
    return levels


def band_phase(
    one: Sensor, light: npt.NDArray[np.uint16], time_s: float, frequency_hz: int
) -> tuple[float, float, float]:
    """Phase in radians of the bands of this flicker, and how much of the rows' variation they explain."""
    levels = rows(one, light, time_s)
    times = READOUT_S / len(levels) * np.arange(len(levels))
    waves = np.column_stack([np.cos(2 * np.pi * frequency_hz * times), np.sin(2 * np.pi * frequency_hz * times)])
    design = np.column_stack([waves, np.ones(len(levels))])
    found, *_ = np.linalg.lstsq(design, levels, rcond=None)
    explained = 1.0 - np.var(levels - design @ found) / np.var(levels)
    return math.atan2(found[1], found[0]), math.hypot(found[0], found[1]), explained


@pytest.mark.parametrize("mains", [50, 60])
def test_without_avoidance_bands_have_the_lamps_period_and_move_with_time(mains: int) -> None:
    one = sensor(mains_hz=mains, flicker_avoidance=False, illuminance_lux=1000.0, mains_flicker=0.4)
    light = flat(0.6)
    exposure_s = one.develop(light).exposure.time_s
    phase, depth, explained = band_phase(one, light, 0.0, 2 * mains)
    assert explained > 0.98
    ripple = 0.4 * math.sin(math.pi * 2 * mains * exposure_s) / (math.pi * 2 * mains * exposure_s)
    assert depth == pytest.approx(100.0 * ripple / 1.5, rel=0.08)
    # A quarter period later the bands have moved by a quarter.
    later, _, _ = band_phase(one, light, 0.25 / (2 * mains), 2 * mains)
    assert math.remainder(phase - later - math.pi / 2, 2 * math.pi) == pytest.approx(0.0, abs=0.06)
    assert band_phase(one, light, 0.0, 3 * mains)[2] < 0.6


def test_bands_vanish_with_avoidance_and_when_the_light_is_steady() -> None:
    light = flat(0.6)
    spread = {}
    cameras: dict[str, dict[str, Any]] = {
        "bands": {"flicker_avoidance": False},
        "avoided": {"flicker_avoidance": True},
        "steady": {"flicker_avoidance": False, "mains_flicker": 0.0},
    }
    for name, camera in cameras.items():
        spread[name] = rows(sensor(illuminance_lux=1500.0, **camera), light, 0.004).std()
    assert spread["bands"] > 5.0
    assert spread["avoided"] < 0.5
    assert spread["steady"] < 0.5


def test_bands_of_a_standing_scene_move_from_frame_to_frame_in_the_world() -> None:
    a_world = world(camera={"flicker_avoidance": False, "illuminance_lux": 2000.0, "mains_flicker": 0.5})
    a_world.request_frames("follower_1", 4)
    frames = [event.image for event in of_kind(run(a_world), Frame)]
    brightness = np.array([frame[:, :, 1].mean(axis=1) for frame in frames], float)
    assert np.abs(brightness[1] - brightness[0]).max() > 10.0
    # 30 frames a second and 100 flashes: every third frame finds the light as it was.
    assert np.abs(brightness[3] - brightness[0]).max() < 2.0


# --- white balance ----------------------------------------------------------------------------------------------------

TUNGSTEN = [255, 141, 52]


def wall(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    colour: npt.NDArray[np.float64] = picture[5:20, 5:60].reshape(-1, 3).astype(float).mean(axis=0)
    return colour


@pytest.mark.parametrize("lamp", [[255, 255, 255], TUNGSTEN, [180, 220, 255]])
def test_auto_white_balance_makes_the_wall_grey_under_any_lamp_also_with_the_marker_in_view(lamp: list[int]) -> None:
    found = wall(sensor(light_colour_rgb=lamp).develop(scene(0.25)).picture)
    assert np.ptp(found) < 0.02 * found.mean()


def test_without_white_balance_the_lamps_colour_stays() -> None:
    off = {"auto_white_balance": False, "auto_white_balance_on_power_up": False}
    development = sensor(light_colour_rgb=TUNGSTEN, camera_brightness=60, illuminance_lux=200.0, **off).develop(scene())
    red, green, blue = wall(development.picture)
    assert development.balance == (1.0, 1.0, 1.0)
    assert red / green == pytest.approx((255 / 141) ** (1 / 1.5), rel=0.03)
    assert blue / green == pytest.approx((52 / 141) ** (1 / 1.5), rel=0.03)


def test_white_balance_on_power_up_keeps_what_the_first_picture_gave() -> None:
    one = sensor(auto_white_balance=False, auto_white_balance_on_power_up=True, light_colour_rgb=TUNGSTEN)
    first = one.develop(flat((0.4, 0.4, 0.5))).balance
    assert first == pytest.approx((1.0, 255 / 141, 255 / 52 * 0.4 / 0.5), rel=1e-3)
    assert one.develop(flat((0.4, 0.3, 0.4))).balance == first


def test_a_picture_without_anything_near_grey_is_left_as_it_is() -> None:
    assert sensor().develop(flat((0.8, 0.05, 0.05))).balance == (1.0, 1.0, 1.0)
    assert sensor().develop(flat(0.0)).balance == (1.0, 1.0, 1.0)


@given(lamp=st.lists(st.integers(1, 255), min_size=3, max_size=3), lux=st.floats(1.0, 1000.0))
@settings(max_examples=20, deadline=None)
def test_the_illuminance_alone_says_how_bright_a_lamp_of_any_colour_is(lamp: list[int], lux: float) -> None:
    off = {"auto_white_balance": False, "auto_white_balance_on_power_up": False, "flicker_avoidance": False}
    small = {"height_px": 16, "width_px": 16, **off, "camera_brightness": 0}
    # The shortest exposure of all: nothing saturates.
    light = flat(0.5, (16, 16, 3))
    white, coloured = (
        (sensor(light_colour_rgb=colour, illuminance_lux=lux, **small).develop(light).levels[0, 0] / 255.0) ** 1.5
        @ LUMINANCE_WEIGHTS
        for colour in ([255, 255, 255], lamp)
    )
    assert coloured == pytest.approx(white, rel=1e-4)


# --- extremes and state -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lux", [0.0, 1e-6, 500.0, 2e5])
def test_extreme_light_gives_a_picture_of_finite_levels(lux: float) -> None:
    for brightness, light, avoid in itertools.product((0, 1, 100, 255), (0.0, 1e-4, 1.0), (True, False)):
        with case(f"brightness {brightness}", f"light {light}", "avoidance" if avoid else "no avoidance"):
            check_extreme_light(brightness, lux, light, avoid)


def check_extreme_light(brightness: int, lux: float, light: float, avoid: bool) -> None:
    one = sensor(camera_brightness=brightness, illuminance_lux=lux, flicker_avoidance=avoid, mains_flicker=1.0)
    development = one.develop(flat(light))
    assert np.isfinite(development.levels).all()
    assert np.isfinite(development.sigma).all()
    picture = one.expose(development, 0.123)
    assert picture.dtype == np.uint8
    assert picture.shape == SHAPE
    if lux * light == 0.0:
        assert picture.mean() < 10.0
        assert development.exposure.gain == MAX_GAIN


def test_a_frame_rate_that_is_no_whole_number_of_steps_is_refused_in_one_sentence() -> None:
    with pytest.raises(ParameterError, match=r"min_frames_per_second' is 61 Hz.*must divide physics_hz = 240"):
        parameters(camera={"min_frames_per_second": 61})


def test_a_lamp_needs_three_colours() -> None:
    with pytest.raises(ParameterError, match="light_colour_rgb' needs three numbers"):
        parameters(camera={"light_colour_rgb": [255, 255]})
