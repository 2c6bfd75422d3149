import math

import numpy as np
import numpy.typing as npt
import pybullet
import pytest

from robot_formation.surface import Surface, make_surface
from robot_formation.world.camera import Camera
from robot_formation.world.events import Frame
from robot_formation.world.marker_picture import marker_picture
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface
from robot_formation.world.scene import FULL
from robot_formation.world.sensor import Sensor
from world_helpers import of_kind, parameters, run, world

PLANE = make_surface("plane")
BOWL = make_surface("bowl")
CORNERS = np.array([[x, -0.03, z] for x in (-0.03, 0.03) for z in (0.156, 0.216)])


def redness(picture: npt.NDArray[np.uint16] | npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    red, green, blue = (picture[..., i].astype(float) for i in range(3))
    found: npt.NDArray[np.float64] = red - 0.5 * (green + blue)
    return found


def box_of(weight: npt.NDArray[np.float64]) -> list[float]:
    """Edges (left, right, top, bottom) of a bright box to a fraction of a pixel, from its profile at half height."""
    half = 0.5 * weight.max()
    edges = []
    for profile in (weight.max(axis=0), weight.max(axis=1)):
        inside = np.flatnonzero(profile > half)
        first, last = inside[0], inside[-1]
        step_in = (profile[first] - half) / (profile[first] - profile[first - 1])
        step_out = (profile[last] - half) / (profile[last] - profile[last + 1])
        edges += [first - step_in, last + step_out]
    return edges


@pytest.mark.parametrize("surface", [PLANE, BOWL])
@pytest.mark.parametrize(("ahead", "aside"), [(0.0, 0.32), (0.03, 0.30), (-0.05, 0.45), (0.0, 0.6)])
def test_the_target_face_appears_where_a_pinhole_puts_its_corners(surface: Surface, ahead: float, aside: float) -> None:
    camera = Camera(surface, WorldParameters())
    looking = pose_on_surface(surface, 0.9, 0.4, 0.0)
    seen = pose_on_surface(surface, 0.9 + ahead, 0.4 + aside, 0.0)
    corners = CORNERS @ seen.matrix().T + np.array(seen.position)
    pixels = camera.project(looking, corners)
    left, right, top, bottom = box_of(redness(camera.light(looking, [seen])))
    # Target's picture spans its corners; on the bowl both robots are tilted alike up to a few degrees.
    assert left == pytest.approx(pixels[:, 0].min(), abs=1.0)
    assert right == pytest.approx(pixels[:, 0].max(), abs=1.0)
    assert top == pytest.approx(pixels[:, 1].min(), abs=1.0)
    assert bottom == pytest.approx(pixels[:, 1].max(), abs=1.0)


def test_in_formation_the_target_face_is_50_px_wide_and_50_px_above_the_centre() -> None:
    left, right, top, bottom = box_of(redness(marker_picture(WorldParameters())))
    assert right - left == pytest.approx(50.07, abs=1.0)
    assert 0.5 * (left + right) == pytest.approx(157.5, abs=0.5)
    assert 103.5 - 0.5 * (top + bottom) == pytest.approx(50.07, abs=0.7)


@pytest.mark.parametrize(("face", "channel"), [("target", 0), ("front", 1), ("rear", 2)])
def test_each_face_has_its_colour(face: str, channel: int) -> None:
    middle = marker_picture(WorldParameters(), face)[40:66, 140:175].reshape(-1, 3).mean(axis=0)
    others = [middle[i] for i in range(3) if i != channel]
    assert middle[channel] > 2.0 * max(others)
    assert middle.sum() > 0.2 * 765


def test_forward_of_the_looking_robot_is_right_in_its_picture() -> None:
    camera = Camera(PLANE, WorldParameters())
    looking = pose_on_surface(PLANE, 0.9, 0.4, 0.0)
    left, right, _, _ = box_of(redness(camera.light(looking, [pose_on_surface(PLANE, 0.95, 0.72, 0.0)])))
    assert 0.5 * (left + right) > 180


def test_the_front_face_shows_when_the_seen_robot_is_behind() -> None:
    camera = Camera(PLANE, WorldParameters())
    picture = camera.light(pose_on_surface(PLANE, 0.9, 0.4, 0.0), [pose_on_surface(PLANE, 0.75, 0.75, 0.0)])
    green = picture[..., 1].astype(int) - picture[..., 0]
    assert np.count_nonzero(green > 0.2 * FULL) > 50


def test_a_nearer_robot_hides_a_farther_one_in_whatever_order_they_are_given() -> None:
    camera = Camera(PLANE, WorldParameters())
    looking = pose_on_surface(PLANE, 0.9, 0.4, 0.0)
    near, far = (pose_on_surface(PLANE, 0.9, 0.4 + distance, 0.0) for distance in (0.32, 0.64))
    alone, both = camera.light(looking, [near]), camera.light(looking, [near, far])
    left, right, top, bottom = (round(edge) for edge in box_of(redness(alone)))
    face = (slice(top + 2, bottom - 1), slice(left + 2, right - 1))
    assert np.array_equal(alone[face], both[face])
    assert np.array_equal(both, camera.light(looking, [far, near]))


@pytest.mark.parametrize("aside", [-0.4, 0.1, 0.15, 0.2])
def test_robots_behind_or_across_the_near_plane_draw_without_error(aside: float) -> None:
    camera = Camera(BOWL, WorldParameters())
    looking = pose_on_surface(BOWL, 0.9, 0.9, 0.0)
    picture = camera.light(looking, [pose_on_surface(BOWL, 0.9, 0.9 + aside, 0.4)])
    assert picture.shape == (208, 316, 3)
    if aside < 0:
        assert np.array_equal(picture, camera.light(looking, []))


@pytest.mark.parametrize("tilt_deg", [-30.0, 0.0, 25.0])
def test_rows_that_only_show_wall_are_what_drawing_them_gives(tilt_deg: float, monkeypatch: pytest.MonkeyPatch) -> None:
    camera = Camera(BOWL, parameters(camera={"tilt_deg": tilt_deg}))
    looking, seen = pose_on_surface(BOWL, 1.3, 0.4, 1.5), [pose_on_surface(BOWL, 0.8, 0.4, 1.5)]
    quick = [camera.light(looking, others) for others in (seen, [])]
    monkeypatch.setattr(camera, "_first_row", lambda faces: 0)
    assert np.array_equal(quick, [camera.light(looking, others) for others in (seen, [])])


def test_light_is_the_reflectance_of_what_is_fully_lit_and_knows_no_exposure() -> None:
    for brightness, lux in ((100, 500.0), (20, 10.0)):
        settings = parameters(camera={"wall_albedo": 64, "camera_brightness": brightness, "illuminance_lux": lux})
        light = Camera(PLANE, settings).light(pose_on_surface(PLANE, 0.9, 0.4, 0.0), [])
        assert light[5:25].mean() == pytest.approx(64 / 255 * FULL, abs=1.0)


def test_a_standing_scene_keeps_its_picture_and_changes_its_noise() -> None:
    a_world = world()
    a_world.request_frames("follower_1", 40)
    frames = np.array([event.image for event in of_kind(run(a_world), Frame)], float)
    assert not np.array_equal(frames[0], frames[1])
    sees = [a_world.ground_truth("leader").pose]
    light = Camera(PLANE, a_world.parameters).light(a_world.ground_truth("follower_1").pose, sees)
    development = Sensor(a_world.parameters.camera, 1, "follower_1").develop(light)
    rounding = 0.5
    largest = 6.0 * development.sigma.max() / math.sqrt(40) + rounding
    assert np.abs(frames.mean(axis=0) - development.picture).max() < largest


def test_noise_depends_only_on_seed_robot_and_number_of_frames_drawn() -> None:
    def last_frame(leader_moves: bool) -> npt.NDArray[np.uint8]:
        a_world = world(camera={"mode": "on_demand"})
        if leader_moves:
            a_world.command("leader", (0.0,) * 4, (0.0,) * 4)
            run(a_world)
        a_world.request_frames("follower_1", 2)
        return of_kind(run(a_world), Frame)[-1].image

    assert np.array_equal(last_frame(False), last_frame(True))


def test_a_render_of_another_make_sees_the_same_target_face() -> None:
    """PyBullet's TinyRenderer draws the cube as an independent check of optics, axes and signs."""
    settings = WorldParameters()
    camera = Camera(BOWL, settings)
    looking = pose_on_surface(BOWL, 0.9, 0.3, 0.2)
    seen = pose_on_surface(BOWL, 0.88, 0.64, 0.15)
    ours = box_of(redness(camera.light(looking, [seen])))
    theirs = box_of(redness(tiny_renderer_picture(camera, looking, seen)))
    assert ours == pytest.approx(theirs, abs=1.5)


def tiny_renderer_picture(camera: Camera, looking: Pose, seen: Pose) -> npt.NDArray[np.uint8]:
    client = pybullet.connect(pybullet.DIRECT)
    try:
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX, halfExtents=[0.03] * 3, rgbaColor=(1, 0, 0, 1), physicsClientId=client
        )
        centre = seen.matrix() @ [0.0, 0.0, 0.186] + seen.position
        pybullet.createMultiBody(0, -1, shape, centre, seen.orientation, physicsClientId=client)
        rotation, lens = camera.optical_frame(looking)
        view = pybullet.computeViewMatrix(lens, lens + rotation[2], -rotation[1])
        field = math.degrees(2 * math.atan(104 / 273.7))
        lens_matrix = pybullet.computeProjectionMatrixFOV(field, 316 / 208, 0.02, 5.0)
        _, _, pixels, _, _ = pybullet.getCameraImage(
            316, 208, view, lens_matrix, renderer=pybullet.ER_TINY_RENDERER, shadow=0, physicsClientId=client
        )
        return np.reshape(pixels, (208, 316, 4))[..., :3]
    finally:
        pybullet.disconnect(physicsClientId=client)
