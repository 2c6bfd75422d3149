"""Values become ROS messages and come back the same; bad ones are refused in one line before they reach a model."""

import array
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray
from sensor_msgs.msg import Image, JointState, PointField
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from robot_formation import conversions
from robot_formation.conversions import MessageError
from robot_formation.drive.movement_system import WheelCommand
from robot_formation.geometry.se2 import Motion
from robot_formation.names import JOINTS, WHEELS
from robot_formation.vision.pixy2.block import Block

stamps = st.integers(0, 2**31 * 10**9 - 1)
finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
angles = st.floats(-1e4, 1e4)
lengths = st.floats(-1e3, 1e3)
motions = st.builds(Motion, lengths, lengths, st.floats(-3.14, 3.14))
four = st.tuples(angles, angles, angles, angles)
NOT_NUMBERS = [math.nan, math.inf, -math.inf]


def over_the_wire(message: Any, type_name: str) -> Any:
    """The message after a trip through CDR."""
    return conversions.from_cdr(conversions.to_cdr(message), type_name)


def refusal(read: Callable[[Any], object], message: Any) -> str:
    with pytest.raises(MessageError) as caught:
        read(message)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# --- time -------------------------------------------------------------------------------------------------------------


@given(stamp=st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
def test_nanoseconds_come_back_exactly(stamp: int) -> None:
    time = conversions.to_time(stamp)
    assert 0 <= time.nanosec < 10**9
    assert conversions.to_ns(time) == stamp


@given(stamp=stamps)
def test_headers_and_the_clock_carry_the_stamp(stamp: int) -> None:
    assert conversions.stamp_of(conversions.move(Motion(), "leader/base_link", stamp)) == stamp
    assert conversions.read_clock(conversions.from_cdr(conversions.clock(stamp), "rosgraph_msgs/msg/Clock")) == stamp


# --- joints -----------------------------------------------------------------------------------------------------------


@given(angles_rad=four, limits=four, stamp=stamps)
def test_a_wheel_command_comes_back_the_same(
    angles_rad: tuple[float, float, float, float], limits: tuple[float, float, float, float], stamp: int
) -> None:
    command = WheelCommand(angles_rad, limits)
    message = over_the_wire(conversions.joint_command(command, stamp), "sensor_msgs/msg/JointState")
    assert conversions.read_joint_command(message) == command
    assert conversions.stamp_of(message) == stamp


@given(order=st.permutations(range(4)))
def test_a_wheel_command_is_read_in_any_joint_order(order: list[int]) -> None:
    values = [1.0, 2.0, 3.0, 4.0]
    message = JointState(
        name=[WHEELS[i] for i in order],
        position=[values[i] for i in order],
        velocity=[10 * values[i] for i in order],
    )
    assert conversions.read_joint_command(message) == WheelCommand((1.0, 2.0, 3.0, 4.0), (10.0, 20.0, 30.0, 40.0))


def command(
    names: Sequence[str] = WHEELS, position: Sequence[float] = (1.0,) * 4, velocity: Sequence[float] = (1.0,) * 4
) -> Any:
    return JointState(name=list(names), position=list(position), velocity=list(velocity))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (command(names=()), "must name front_left_wheel, front_right_wheel, .* once each, not nothing"),
        (command(names=WHEELS[:3]), "once each, not front_left_wheel, front_right_wheel, rear_left_wheel"),
        (command(names=(*WHEELS[:3], WHEELS[0])), "once each"),
        (command(names=(*WHEELS, "arm")), "once each"),
        (command(names=("a", "b", "c", "d")), "not a, b, c, d"),
        (command(position=()), "4 positions"),
        (command(position=(1.0,) * 5), "4 positions"),
        (command(velocity=()), "4 velocities"),
        (command(position=(1e4 + 1, 0, 0, 0)), "1e[+]04 is absurd"),
        (command(position=(0, 0, -1e300, 0)), "absurd"),
    ],
)
def test_a_wheel_command_that_cannot_be_meant_is_refused(message: Any, words: str) -> None:
    with pytest.raises(MessageError, match=words):
        conversions.read_joint_command(message)
    assert "joint_commands" in refusal(conversions.read_joint_command, message)


@pytest.mark.parametrize("bad", NOT_NUMBERS)
@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("field", ["position", "velocity"])
def test_no_wheel_command_that_is_not_finite_passes(field: str, place: int, bad: float) -> None:
    values: dict[str, Any] = {field: [1.0] * 4}
    values[field][place] = bad
    assert "finite" in refusal(conversions.read_joint_command, command(**values))


six = st.lists(finite, min_size=6, max_size=6)


@given(positions=six, velocities=six, stamp=stamps, order=st.permutations(range(6)))
def test_joint_states_come_back_in_the_order_of_the_drive(
    positions: list[float], velocities: list[float], stamp: int, order: list[int]
) -> None:
    message = over_the_wire(
        conversions.joint_states(
            [JOINTS[i] for i in order], [positions[i] for i in order], [velocities[i] for i in order], stamp
        ),
        "sensor_msgs/msg/JointState",
    )
    assert conversions.read_joint_states(message) == (positions, velocities)
    assert conversions.stamp_of(message) == stamp


def test_joints_that_the_drive_does_not_know_are_left_out() -> None:
    message = conversions.joint_states(["arm", *JOINTS], range(7), range(7), 0)
    assert conversions.read_joint_states(message)[0] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


@pytest.mark.parametrize(
    ("names", "count", "words"),
    [
        ([], 0, "missing: front_left_wheel"),
        (JOINTS[:5], 5, "missing: encoder_wheel_u"),
        (JOINTS, 5, "missing: values"),
        ((*JOINTS, JOINTS[0]), 7, "missing: values"),
    ],
    ids=["nothing", "a joint missing", "a value missing", "a joint twice"],
)
def test_joint_states_that_leave_something_out_are_refused(names: Sequence[str], count: int, words: str) -> None:
    message = conversions.joint_states(names, [0.0] * count, [0.0] * count, 0)
    assert words in refusal(conversions.read_joint_states, message)


def test_joint_states_without_velocities_are_refused() -> None:
    assert "one velocity" in refusal(conversions.read_joint_states, conversions.joint_states(JOINTS, [0.0] * 6, [], 0))


@pytest.mark.parametrize("bad", NOT_NUMBERS)
@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("field", [0, 1])
def test_no_joint_states_that_are_not_finite_pass(field: int, place: int, bad: float) -> None:
    values = [[0.0] * 6, [0.0] * 6]
    values[field][place] = bad
    positions, velocities = values
    message = conversions.joint_states(JOINTS, positions, velocities, 0)
    assert "finite" in refusal(conversions.read_joint_states, message)


# --- planar motions ---------------------------------------------------------------------------------------------------


def close(found: Motion, expected: Motion) -> None:
    assert (found.x_m, found.y_m) == (expected.x_m, expected.y_m)
    assert found.yaw_rad == pytest.approx(expected.yaw_rad, abs=1e-15)


@given(motion=motions, stamp=stamps)
def test_a_move_comes_back_the_same(motion: Motion, stamp: int) -> None:
    message = over_the_wire(conversions.move(motion, "follower_1/base_link", stamp), "geometry_msgs/msg/PoseStamped")
    close(conversions.read_move(message), motion)
    assert message.header.frame_id == "follower_1/base_link"
    assert conversions.stamp_of(message) == stamp


@given(motion=motions, stamp=stamps, variances=st.tuples(lengths, lengths, lengths, lengths))
def test_a_displacement_comes_back_with_its_covariance_in_the_corner_of_x_and_y(
    motion: Motion, stamp: int, variances: tuple[float, float, float, float]
) -> None:
    message = over_the_wire(
        conversions.displacement(motion, "leader/base_link", stamp, variances),
        "geometry_msgs/msg/PoseWithCovarianceStamped",
    )
    close(conversions.read_displacement(message), motion)
    covariance = np.reshape(message.pose.covariance, (6, 6))
    assert tuple(covariance[:2, :2].ravel()) == variances
    covariance[:2, :2] = 0.0
    assert not covariance.any()
    assert conversions.stamp_of(message) == stamp
    assert message.header.frame_id == "leader/base_link"


def test_no_estimate_is_told_from_an_estimate() -> None:
    def of(covariance: Sequence[float]) -> bool:
        return conversions.has_estimate(conversions.displacement(Motion(), "", 0, covariance))

    assert of((0.0,) * 4)
    assert of((1e-8, 0.0, 0.0, 1e-8))
    assert not of(conversions.NO_ESTIMATE)
    assert not of((math.nan, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("bad", NOT_NUMBERS)
@pytest.mark.parametrize("part", ["position.x", "position.y", "orientation.x", "orientation.z", "orientation.w"])
def test_what_is_not_finite_in_a_pose_stays_so_for_the_core_to_refuse(part: str, bad: float) -> None:
    message = conversions.move(Motion(0.1, 0.2, 0.3), "base_link", 0)
    group, component = part.split(".")
    setattr(getattr(message.pose, group), component, bad)
    assert not conversions.read_move(message).finite


@given(yaw=st.floats(-3.14, 3.14), length=st.floats(1e-3, 1e3))
def test_a_quaternion_of_any_length_gives_its_yaw(yaw: float, length: float) -> None:
    message = conversions.move(Motion(yaw_rad=yaw), "base_link", 0)
    message.pose.orientation.z *= length
    message.pose.orientation.w *= length
    assert conversions.read_move(message).yaw_rad == pytest.approx(yaw, abs=1e-12)


@given(roll=st.floats(-0.5, 0.5), pitch=st.floats(-0.5, 0.5), yaw=st.floats(-3.14, 3.14))
def test_yaw_is_read_from_a_tilted_pose_too(roll: float, pitch: float, yaw: float) -> None:
    def about(axis: int, angle: float) -> NDArray[np.float64]:
        c, s = math.cos(angle), math.sin(angle)
        matrix = np.eye(3)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        matrix[i, i] = matrix[j, j] = c
        matrix[i, j], matrix[j, i] = -s, s
        return matrix

    rotation = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    # The quaternion of a rotation matrix: the eigenvector of the largest eigenvalue of Bar-Itzhack's 4 x 4 form.
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    form = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    x, y, z, w = np.linalg.eigh(form)[1][:, -1]
    found = conversions.read_pose(conversions.pose((1, 2, 3), (x, y, z, w), "world", 5).pose)
    assert (found.x_m, found.y_m) == (1.0, 2.0)
    assert found.yaw_rad == pytest.approx(yaw, abs=1e-9)


def test_an_orientation_of_zeros_is_no_turn() -> None:
    message = conversions.move(Motion(0.1), "base_link", 0)
    message.pose.orientation.w = 0.0
    assert conversions.read_move(message) == Motion(0.1)


def test_odometry_has_its_frames_pose_and_velocities_in_their_fields() -> None:
    data = conversions.body_odometry(
        (1, 2, 3), (0, 0, 0, 1), (4, 5, 6), (7, 8, 9), frame="world", child="leader/base_link", stamp_ns=5 * 10**9 + 7
    )
    message = conversions.from_cdr(data, "nav_msgs/msg/Odometry")
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (5, 7)
    assert (message.header.frame_id, message.child_frame_id) == ("world", "leader/base_link")
    assert message.pose.pose.position.z == 3.0
    assert (message.twist.twist.linear.x, message.twist.twist.angular.z) == (4.0, 9.0)
    assert not any([*message.pose.covariance, *message.twist.covariance])
    pose = conversions.pose((1, 2, 3), (0, 0, 0, 1), "world", 5 * 10**9 + 7)
    assert (pose.header, pose.pose) == (message.header, message.pose.pose)
    planar = conversions.odometry(Motion(1.0, 2.0, 0.5), "leader/odom", "leader/base_link", 3)
    close(conversions.read_pose(planar.pose.pose), Motion(1.0, 2.0, 0.5))


names_of_frames = st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=12)
poses_of_a_path = st.tuples(stamps, names_of_frames, st.lists(st.floats(allow_nan=False), min_size=7, max_size=7))


@given(poses=st.lists(poses_of_a_path, max_size=4), frame=names_of_frames, stamp=stamps)
def test_a_path_is_serialised_as_by_rclpy_but_for_the_bytes_that_align_numbers(
    poses: list[tuple[int, str, list[float]]], frame: str, stamp: int
) -> None:
    made = [conversions.path_pose(p[:3], of, at, p[3:]) for at, of, p in poses]
    messages = [conversions.pose(p[:3], p[3:], of, at) for at, of, p in poses]
    whole = Path(header=conversions.header(stamp, frame), poses=messages)
    cdr = conversions.path(made, frame, stamp)
    assert conversions.from_cdr(cdr, "nav_msgs/msg/Path") == whole
    assert len(cdr) == len(conversions.to_cdr(whole))


def test_a_planar_pose_of_a_path_is_that_of_a_move() -> None:
    motion = Motion(1.0, -2.0, 0.5)
    path = conversions.path([conversions.planar_path_pose(motion, "odom", 5)], "odom", 7)
    assert conversions.from_cdr(path, "nav_msgs/msg/Path").poses == [conversions.move(motion, "odom", 5)]


# --- pictures ---------------------------------------------------------------------------------------------------------

pictures = st.tuples(st.integers(1, 9), st.integers(1, 9)).flatmap(
    lambda size: arrays(np.uint8, (*size, 3), elements=st.integers(0, 255))
)


@settings(deadline=None)
@given(pixels=pictures, stamp=stamps)
def test_a_picture_comes_back_the_same(pixels: NDArray[np.uint8], stamp: int) -> None:
    message = over_the_wire(conversions.image(pixels, "camera", stamp), "sensor_msgs/msg/Image")
    assert (conversions.read_image(message) == pixels).all()
    assert (message.height, message.width) == pixels.shape[:2]
    assert (message.encoding, message.header.frame_id) == ("rgb8", "camera")
    assert conversions.stamp_of(message) == stamp


@settings(deadline=None)
@given(pixels=pictures, padding=st.integers(0, 5), swapped=st.booleans())
def test_padded_rows_and_the_other_order_of_colours_are_read_too(
    pixels: NDArray[np.uint8], padding: int, swapped: bool
) -> None:
    height, width = pixels.shape[:2]
    rows = np.full((height, 3 * width + padding), 77, np.uint8)
    rows[:, : 3 * width] = (pixels[:, :, ::-1] if swapped else pixels).reshape(height, -1)
    message = Image(height=height, width=width, step=3 * width + padding, encoding="bgr8" if swapped else "rgb8")
    message.data = array.array("B", rows.tobytes())
    assert (conversions.read_image(message) == pixels).all()


def picture(**values: Any) -> Any:
    message = conversions.image(np.zeros((4, 5, 3), np.uint8), "camera", 0)
    for name, value in values.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (picture(encoding="mono8"), "'mono8' has no colour to find blocks by; send rgb8 or bgr8"),
        (picture(encoding=""), "''"),
        (picture(encoding="rgba8"), "'rgba8'"),
        (picture(data=array.array("B", bytes(59))), "has 59 bytes: cut off or mis-sized"),
        (picture(data=array.array("B", bytes(61))), "has 61 bytes: cut off or mis-sized"),
        (picture(data=array.array("B")), "has 0 bytes"),
        (picture(step=14), "step 14"),
        (picture(width=0, step=0), "0 x 4"),
        (picture(height=0), "5 x 0"),
        (picture(height=2**32 - 1, width=2**32 - 1, step=2**32 - 1), "mis-sized"),
        (picture(height=2**30, step=2**30), "mis-sized"),  # step * height is 0 in 32 bits
        (Image(), "''"),
    ],
)
def test_a_picture_that_is_cut_off_or_colourless_is_refused(message: Any, words: str) -> None:
    assert words in refusal(conversions.read_image, message)


def test_the_camera_matrix_projects_as_a_pinhole_camera() -> None:
    info = conversions.camera_info(316, 208, 273.7, (157.5, 103.5), "camera", 5)
    k, p = np.reshape(info.k, (3, 3)), np.reshape(info.p, (3, 4))
    point = np.array([0.1, -0.05, 0.5, 1.0])
    projected = p @ point
    assert projected[:2] / projected[2] == pytest.approx([157.5 + 273.7 * 0.2, 103.5 - 273.7 * 0.1])
    assert (p[:, :3] == k).all()
    assert (np.reshape(info.r, (3, 3)) == np.eye(3)).all()
    assert not any(info.d)
    assert (info.width, info.height, info.distortion_model) == (316, 208, "plumb_bob")


# --- blocks -----------------------------------------------------------------------------------------------------------

u16, u8 = st.integers(0, 2**16 - 1), st.integers(0, 255)
block_lists = st.lists(st.builds(Block, u16, u16, u16, u16, u16, st.integers(-(2**15), 2**15 - 1), u8, u8), max_size=9)


@settings(deadline=None)
@given(found=block_lists, stamp=stamps)
def test_blocks_come_back_the_same_also_when_there_are_none(found: list[Block], stamp: int) -> None:
    message = over_the_wire(conversions.blocks(found, "camera", stamp), "sensor_msgs/msg/PointCloud2")
    assert conversions.read_blocks(message) == found
    assert (message.width, message.height) == (len(found), 1)
    assert (message.header.frame_id, conversions.stamp_of(message)) == ("camera", stamp)


def test_blocks_can_be_decoded_by_their_own_fields_alone() -> None:
    # As any point cloud reader does it, without this package's record type.
    found = [Block(1, 2, 3, 4, 5, -6, 7, 8), Block(3, 300, 200, 50, 49, 0, 255, 255)]
    message = conversions.blocks(found, "camera", 0)
    kinds = {PointField.UINT16: "<u2", PointField.INT16: "<i2", PointField.UINT8: "u1"}
    layout = np.dtype(
        {
            "names": [field.name for field in message.fields],
            "formats": [kinds[field.datatype] for field in message.fields],
            "offsets": [field.offset for field in message.fields],
            "itemsize": message.point_step,
        }
    )
    table = np.frombuffer(bytes(message.data), layout)
    assert layout.names is not None
    assert [Block(**{name: int(row[name]) for name in layout.names}) for row in table] == found
    assert message.row_step == message.point_step * message.width


def block_message(**values: Any) -> Any:
    message = conversions.blocks([Block(1, 158, 60, 49, 49)], "camera", 0)
    for name, value in values.items():
        setattr(message, name, value)
    return message


def fields(change: Callable[[list[Any]], object]) -> list[Any]:
    """The fields of blocks with one changed."""
    found = [
        PointField(name=field.name, offset=field.offset, datatype=field.datatype, count=field.count)
        for field in block_message().fields
    ]
    change(found)
    return found


@pytest.mark.parametrize(
    "message",
    [
        block_message(fields=[]),
        block_message(fields=fields(lambda found: found.pop())),
        block_message(fields=fields(lambda found: found.reverse())),
        block_message(fields=fields(lambda found: setattr(found[1], "name", "z"))),
        block_message(fields=fields(lambda found: setattr(found[1], "offset", 4))),
        block_message(fields=fields(lambda found: setattr(found[1], "datatype", PointField.INT16))),
        block_message(point_step=16),
        block_message(is_bigendian=True),
    ],
    ids=["no fields", "one less", "another order", "another name", "another offset", "another type", "step", "endian"],
)
def test_points_that_are_not_laid_out_as_blocks_are_refused(message: Any) -> None:
    words = refusal(conversions.read_blocks, message)
    assert "packed little-endian fields signature uint16, x uint16" in words


@pytest.mark.parametrize("values", [{"width": 2}, {"width": 0}, {"height": 2}, {"data": array.array("B", bytes(13))}])
def test_blocks_whose_number_and_bytes_disagree_are_refused(values: Any) -> None:
    assert "cut off or mis-sized" in refusal(conversions.read_blocks, block_message(**values))


# --- the rest ---------------------------------------------------------------------------------------------------------


@given(value=st.integers(0, 2**32 - 1))
def test_a_tick_comes_back_the_same(value: int) -> None:
    assert over_the_wire(conversions.uint32(value), "std_msgs/msg/UInt32").data == value


@given(text=st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0")))
def test_a_text_comes_back_the_same(text: str) -> None:
    assert over_the_wire(conversions.string(text), "std_msgs/msg/String").data == text


def test_health_has_its_level_text_and_values() -> None:
    message = over_the_wire(
        conversions.diagnostics("/leader/drive", 1, "slow", {"warnings": "3"}, 7), "diagnostic_msgs/msg/DiagnosticArray"
    )
    (status,) = message.status
    assert (status.level, status.name, status.message) == (b"\x01", "/leader/drive", "slow")
    assert [(entry.key, entry.value) for entry in status.values] == [("warnings", "3")]


def test_a_mesh_becomes_three_coloured_corners_per_triangle() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]])
    colours = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    data = conversions.surface_marker(vertices, colours, np.array([[0, 1, 3], [0, 3, 2]]), "world")
    marker = conversions.from_cdr(data, "visualization_msgs/msg/Marker")
    assert [(p.x, p.y, p.z) for p in marker.points[3:]] == [(0, 0, 0), (1, 1, 1), (0, 1, 0)]
    assert [(c.r, c.g, c.b, c.a) for c in marker.colors[:3]] == [(0, 0, 0, 1), (1, 0, 0, 1), (0, 0, 1, 1)]
    assert marker.header.frame_id == "world"


@pytest.mark.parametrize("frame", ["", "w", "wo", "wor", "worl", "world", "world2", "world23"])
@pytest.mark.parametrize("count", [0, 1, 2])
def test_messages_made_serialised_are_those_of_the_message_classes(frame: str, count: int) -> None:
    """With names of all lengths: numbers behind them lie at multiples of their size."""
    marker = Marker(ns="surface", type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.header.frame_id = frame
    marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = marker.color.a = 1.0
    for _ in range(count):
        marker.points += [Point(x=1.0, y=2.0, z=3.0), Point(x=4.0, y=5.0, z=6.0), Point(x=7.0, y=8.0, z=9.0)]
        marker.colors += [ColorRGBA(r=0.25 * part, g=0.5, b=1.0, a=1.0) for part in range(3)]
    vertices, shades = np.arange(1.0, 10.0).reshape(3, 3), np.array([[0.25 * part, 0.5, 1.0] for part in range(3)])
    data = conversions.surface_marker(vertices, shades, np.array([[0, 1, 2]] * count, np.int64).reshape(-1, 3), frame)
    assert conversions.from_cdr(data, "visualization_msgs/msg/Marker") == marker
    assert len(data) == len(conversions.to_cdr(marker))
    odometry = Odometry(child_frame_id=f"{frame}/child")
    odometry.header.frame_id, odometry.header.stamp.sec = frame, -3
    pose, twist = odometry.pose.pose, odometry.twist.twist
    pose.position.x, pose.position.z, pose.orientation.w, twist.linear.y, twist.angular.z = (
        1.5,
        -2.5,
        1.0,
        0.5,
        math.inf,
    )
    data = conversions.body_odometry(
        (1.5, 0, -2.5),
        (0, 0, 0, 1),
        (0, 0.5, 0),
        (0, 0, math.inf),
        frame=frame,
        child=f"{frame}/child",
        stamp_ns=-3 * 10**9,
    )
    assert conversions.from_cdr(data, "nav_msgs/msg/Odometry") == odometry
    assert len(data) == len(conversions.to_cdr(odometry))
