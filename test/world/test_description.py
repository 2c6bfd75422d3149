"""The robots' URDF: a tree of the right frames where the simulation has them."""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt
import pybullet
import pytest

from robot_formation.names import JOINTS
from robot_formation.surface import make_surface
from robot_formation.world.camera import Camera
from robot_formation.world.description import robot_description
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface
from world_helpers import parameters


def tree_of(settings: WorldParameters | None = None, *, camera: bool = True) -> Element:
    return ElementTree.fromstring(robot_description("follower_1", settings or WorldParameters(), camera=camera))


def value(element: Element, path: str, attribute: str) -> str:
    """An attribute of the element at this path."""
    found = element.find(path)
    assert found is not None, path
    return found.attrib[attribute]


def rotation(rpy: Sequence[float]) -> npt.NDArray[np.float64]:
    """URDF's fixed-axis roll, pitch, yaw as a matrix."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    matrix: npt.NDArray[np.float64] = about_z @ about_y @ about_x
    return matrix


def frames(tree: Element) -> dict[str, npt.NDArray[np.float64]]:
    """Pose (4, 4) in base_link of every link."""
    found = {"base_link": np.eye(4)}
    for joint in tree.iter("joint"):
        step = np.eye(4)
        step[:3, :3] = rotation([float(v) for v in value(joint, "origin", "rpy").split()])
        step[:3, 3] = [float(v) for v in value(joint, "origin", "xyz").split()]
        found[value(joint, "child", "link")] = found[value(joint, "parent", "link")] @ step
    return found


def test_it_is_one_tree_with_the_documented_links() -> None:
    tree = tree_of()
    links = [link.get("name", "") for link in tree.iter("link")]
    assert sorted(links) == sorted(["base_link", *JOINTS, "marker", "camera_link", "camera_optical_frame"])
    assert tree.tag == "robot"
    assert tree.get("name") == "follower_1"
    children = [value(joint, "child", "link") for joint in tree.iter("joint")]
    assert sorted([*children, "base_link"]) == sorted(links)
    assert set(frames(tree)) == set(links)


def test_a_robot_without_camera_has_no_camera_links() -> None:
    assert not [link for link in tree_of(camera=False).iter("link") if "camera" in link.get("name", "")]


@pytest.mark.parametrize("view", [{}, {"pan_deg": 60.0, "tilt_deg": 12.0, "x_m": 0.03}])
def test_the_optical_frame_is_the_simulated_cameras(view: dict[str, float]) -> None:
    settings = parameters(camera=view)
    ground = make_surface("bowl")
    pose = pose_on_surface(ground, 0.5, 0.6, 0.4)
    axes, lens = Camera(ground, settings).optical_frame(pose)
    optical = frames(tree_of(settings))["camera_optical_frame"]
    assert pose.matrix() @ optical[:3, :3] == pytest.approx(axes.T, abs=1e-5)
    assert pose.matrix() @ optical[:3, 3] + pose.position == pytest.approx(lens, abs=1e-6)


def test_joints_of_wheels_are_those_of_the_joint_states_and_turn_the_right_way() -> None:
    joints = {joint.get("name"): joint for joint in tree_of().iter("joint")}
    radii = {
        link.get("name"): value(link, "visual/geometry/cylinder", "radius")
        for link in tree_of().iter("link")
        if link.find("visual/geometry/cylinder") is not None
    }
    for name in JOINTS:
        joint = joints[name]
        assert joint.get("type") == "continuous"
        axis = np.array([float(v) for v in value(joint, "axis", "xyz").split()])
        # A wheel on the ground that turns about its axis carries its middle along axis x up.
        carried = np.cross(axis, [0.0, 0.0, 1.0])
        assert carried == pytest.approx([0, 1, 0] if name == "encoder_wheel_u" else [1, 0, 0])
        radius = float(radii[name])
        assert frames(tree_of())[name][2, 3] == pytest.approx(radius)
    front_left = frames(tree_of())["front_left_wheel"][:3, 3]
    assert front_left == pytest.approx([0.11, 0.095, 0.03])


def test_sizes_masses_and_the_marker_follow_the_parameters() -> None:
    settings = parameters(chassis={"length_m": 0.4, "mass_kg": 2.0}, marker={"top_m": 0.25})
    tree = tree_of(settings)
    (base,) = [link for link in tree.iter("link") if link.get("name") == "base_link"]
    assert value(base, "collision/geometry/box", "size") == "0.4 0.238 0.128"
    assert float(value(base, "inertial/mass", "value")) == 2.0
    izz = float(value(base, "inertial/inertia", "izz"))
    assert izz == pytest.approx(2.0 / 12 * (0.4**2 + 0.238**2), rel=1e-5)
    assert frames(tree)["marker"][2, 3] == pytest.approx(0.25 - 0.03)


def test_numbers_are_finite_and_the_text_begins_as_xml() -> None:
    text = robot_description("leader", WorldParameters(), camera=False)
    assert text.startswith("<?xml")
    for element in ElementTree.fromstring(text).iter():
        for key in ("xyz", "rpy", "size", "rgba"):
            assert all(math.isfinite(float(v)) for v in element.get(key, "0").split())


def test_a_reader_of_another_make_builds_the_same_frames(tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text(robot_description("follower_1", WorldParameters(), camera=True))
    client = pybullet.connect(pybullet.DIRECT)
    try:
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_MAINTAIN_LINK_ORDER
        robot = pybullet.loadURDF(str(file), flags=flags, physicsClientId=client)
        count = pybullet.getNumJoints(robot, physicsClientId=client)
        expected = frames(tree_of())
        mass_place = np.array([0.0, 0.0, WorldParameters().chassis.mass_height_m])
        origin = np.array(pybullet.getBasePositionAndOrientation(robot, physicsClientId=client)[0]) - mass_place
        for index in range(count):
            name = pybullet.getJointInfo(robot, index, physicsClientId=client)[12].decode()
            link = pybullet.getLinkState(robot, index, physicsClientId=client)
            place, turn = link[4], pybullet.getMatrixFromQuaternion(link[5])
            assert np.array(place) - origin == pytest.approx(expected[name][:3, 3], abs=1e-5)
            assert np.reshape(turn, (3, 3)) == pytest.approx(expected[name][:3, :3], abs=1e-5)
        assert count == len(expected) - 1
    finally:
        pybullet.disconnect(client)
