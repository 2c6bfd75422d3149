"""ROS messages from the project's values and back. The only module outside nodes/ that knows message packages.

Readers check what comes from outside and raise `MessageError` before anything reaches a model or a wheel.
"""

from __future__ import annotations

import array
import importlib
import math
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header, String, UInt32
from visualization_msgs.msg import Marker

from robot_formation.control.drive import JOINTS, WHEELS, WheelCommand
from robot_formation.control.motion import Motion
from robot_formation.errors import FormationError
from robot_formation.vision.block import Block

_NS = 1_000_000_000
_LARGEST_WHEEL_ANGLE_RAD = 1e4

# One point per block. x, y, width and height are pixels, angle degrees, index and age counts (Pixy2 getBlocks record).
BLOCK_DTYPE = np.dtype(
    [
        ("signature", "<u2"),
        ("x", "<u2"),
        ("y", "<u2"),
        ("width", "<u2"),
        ("height", "<u2"),
        ("angle", "<i2"),
        ("index", "u1"),
        ("age", "u1"),
    ]
)
_POINT_FIELD_TYPES = {"<u2": PointField.UINT16, "<i2": PointField.INT16, "|u1": PointField.UINT8}


class MessageError(FormationError):
    """A message can't be used; the text says why."""


@cache
def message_class(type_name: str) -> Any:
    """Import the class of 'package/msg/Name'."""
    package, _, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def to_cdr(message: Any) -> bytes:
    """Serialise a message as it goes over the wire and into a bag."""
    return serialize_message(message)  # type: ignore[no-any-return]


def from_cdr(data: bytes, type_name: str) -> Any:
    """Deserialise a message of 'package/msg/Name'."""
    return deserialize_message(data, message_class(type_name))


def to_time(stamp_ns: int) -> Time:
    """Convert integer nanoseconds to a ROS time."""
    return Time(sec=stamp_ns // _NS, nanosec=stamp_ns % _NS)


def to_ns(time: Time) -> int:
    """Convert a ROS time to integer nanoseconds."""
    return int(time.sec) * _NS + int(time.nanosec)


def header(stamp_ns: int, frame: str = "") -> Header:
    """Make a header."""
    return Header(stamp=to_time(stamp_ns), frame_id=frame)


def stamp_of(message: Any) -> int:
    """Read a stamped message's time in nanoseconds."""
    return to_ns(message.header.stamp)


def clock(stamp_ns: int) -> Clock:
    """Make a /clock message."""
    return Clock(clock=to_time(stamp_ns))


def uint32(value: int) -> UInt32:
    """Make a tick or a count."""
    return UInt32(data=value)


def string(text: str) -> String:
    """Make a text."""
    return String(data=text)


def joint_command(command: WheelCommand, stamp_ns: int) -> JointState:
    """Relative wheel angles [rad] as `position`, speed limits [rad/s] as `velocity`; `frame_id` numbers the command.

    `effort` is not used, but filled: rosbags can't read what some CDR writers put behind an empty last list.
    """
    return JointState(
        header=header(stamp_ns, command.number),
        name=list(WHEELS),
        position=list(command.angles_rad),
        velocity=list(command.limits_rad_s),
        effort=[0.0] * len(WHEELS),
    )


def read_joint_command(message: JointState) -> WheelCommand:
    """Read relative wheel angles and speed limits in any joint order."""
    if sorted(message.name) != sorted(WHEELS):
        raise MessageError(
            f"joint_commands must name {', '.join(WHEELS)} once each, not {', '.join(message.name) or 'nothing'}"
        )
    if len(message.position) != len(WHEELS) or len(message.velocity) != len(WHEELS):
        raise MessageError(
            f"joint_commands must have {len(WHEELS)} positions (rad) and {len(WHEELS)} velocities (rad/s)"
        )
    order = [list(message.name).index(name) for name in WHEELS]
    angles = tuple(float(message.position[i]) for i in order)
    limits = tuple(float(message.velocity[i]) for i in order)
    if not all(map(math.isfinite, angles + limits)):
        raise MessageError("joint_commands must be finite")
    if max(map(abs, angles)) > _LARGEST_WHEEL_ANGLE_RAD:
        raise MessageError(f"joint_commands are relative angles in rad; {max(map(abs, angles)):.3g} is absurd")
    return WheelCommand(angles, limits, message.header.frame_id)


def joint_states(
    names: Sequence[str], positions: Sequence[float], velocities: Sequence[float], stamp_ns: int, number: str = ""
) -> JointState:
    """Make the joints' report: positions [rad], velocities [rad/s]; `frame_id` is the number of the last command."""
    return JointState(
        header=header(stamp_ns, number),
        name=list(names),
        position=list(positions),
        velocity=list(velocities),
        effort=[0.0] * len(names),
    )


def read_joint_states(message: JointState) -> tuple[list[float], list[float]]:
    """Read positions [rad] and velocities [rad/s] in the order of `drive.JOINTS`."""
    index = {name: i for i, name in enumerate(message.name)}
    missing = [name for name in JOINTS if name not in index]
    if missing or len(message.position) != len(index) or len(message.velocity) != len(index):
        raise MessageError(
            f"joint_states must have one position and one velocity of each joint ({', '.join(JOINTS)}); "
            f"missing: {', '.join(missing) or 'values'}"
        )
    positions = [float(message.position[index[name]]) for name in JOINTS]
    velocities = [float(message.velocity[index[name]]) for name in JOINTS]
    if not all(map(math.isfinite, positions + velocities)):
        raise MessageError("joint_states must be finite")
    return positions, velocities


def _set_planar(pose: Pose, motion: Motion) -> None:
    pose.position.x, pose.position.y = motion.x_m, motion.y_m
    pose.orientation.z, pose.orientation.w = math.sin(motion.yaw_rad / 2.0), math.cos(motion.yaw_rad / 2.0)


def move(motion: Motion, frame: str, stamp_ns: int) -> PoseStamped:
    """Make a move's target in the robot's `base_link`."""
    message = PoseStamped(header=header(stamp_ns, frame))
    _set_planar(message.pose, motion)
    return message


def read_pose(pose: Pose) -> Motion:
    """Read a planar displacement: x, y and yaw. Not-finite values are kept for the core to refuse."""
    o = pose.orientation
    # A quaternion of any length gives its yaw; atan2 would make a number of infinite components.
    yaw = math.atan2(2.0 * (o.w * o.z + o.x * o.y), o.w * o.w + o.x * o.x - o.y * o.y - o.z * o.z)
    if not all(map(math.isfinite, (o.x, o.y, o.z, o.w))):
        yaw = math.nan
    return Motion(float(pose.position.x), float(pose.position.y), yaw)


def read_move(message: PoseStamped) -> Motion:
    """Read a move's target."""
    return read_pose(message.pose)


def displacement(
    motion: Motion, frame: str, stamp_ns: int, covariance_xy: Sequence[float] = (0.0, 0.0, 0.0, 0.0)
) -> PoseWithCovarianceStamped:
    """Make a displacement with the covariance of (x, y), row by row [m^2]; a negative first one means 'no estimate'."""
    message = PoseWithCovarianceStamped(header=header(stamp_ns, frame))
    _set_planar(message.pose.pose, motion)
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = np.reshape(covariance_xy, (2, 2))
    message.pose.covariance = covariance.ravel()
    return message


NO_ESTIMATE = (-1.0, 0.0, 0.0, 0.0)


def read_displacement(message: PoseWithCovarianceStamped) -> Motion:
    """Read a displacement's mean."""
    return read_pose(message.pose.pose)


def has_estimate(message: PoseWithCovarianceStamped) -> bool:
    """Tell whether a displacement was estimated at all."""
    return float(message.pose.covariance[0]) >= 0.0


def odometry(motion: Motion, frame: str, child: str, stamp_ns: int) -> Odometry:
    """Make planar odometry."""
    message = Odometry(header=header(stamp_ns, frame), child_frame_id=child)
    _set_planar(message.pose.pose, motion)
    return message


def body_odometry(
    position: Sequence[float],
    quaternion_xyzw: Sequence[float],
    linear: Sequence[float],
    angular: Sequence[float],
    *,
    frame: str,
    child: str,
    stamp_ns: int,
) -> Odometry:
    """Make a full pose in `frame`; velocities are in the child frame, as nav_msgs/Odometry asks."""
    message = Odometry(header=header(stamp_ns, frame), child_frame_id=child)
    p, o, twist = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
    p.x, p.y, p.z = map(float, position)
    o.x, o.y, o.z, o.w = map(float, quaternion_xyzw)
    twist.linear.x, twist.linear.y, twist.linear.z = map(float, linear)
    twist.angular.x, twist.angular.y, twist.angular.z = map(float, angular)
    return message


def pose_of(odometry_message: Odometry) -> PoseStamped:
    """Take the pose out of an odometry message."""
    return PoseStamped(header=odometry_message.header, pose=odometry_message.pose.pose)


def place(position: Sequence[float], frame: str, stamp_ns: int) -> PoseStamped:
    """Make a pose of which only the place (x, y, z) is known: its orientation is the frame's."""
    message = PoseStamped(header=header(stamp_ns, frame))
    p = message.pose.position
    p.x, p.y, p.z = map(float, position)
    return message


def pose_array(poses: Sequence[PoseStamped], frame: str, stamp_ns: int) -> PoseArray:
    """Make one message of several poses."""
    return PoseArray(header=header(stamp_ns, frame), poses=[stamped.pose for stamped in poses])


def path(poses: Sequence[PoseStamped], frame: str, stamp_ns: int) -> Path:
    """Make a path."""
    return Path(header=header(stamp_ns, frame), poses=list(poses))


def image(pixels: NDArray[np.uint8], frame: str, stamp_ns: int) -> Image:
    """Make an rgb8 image from (height, width, 3), a mono8 one from (height, width)."""
    height, width = pixels.shape[:2]
    encoding, channels = ("mono8", 1) if pixels.ndim == 2 else ("rgb8", 3)
    message = Image(header=header(stamp_ns, frame), height=height, width=width, encoding=encoding)
    message.step = channels * width
    # Assigning an array('B') is checked in 0.1 ms, a list in 4 ms.
    message.data = array.array("B", pixels.tobytes())
    return message


def read_image(message: Image) -> NDArray[np.uint8]:
    """Read an rgb8 or bgr8 image, padded rows included, as RGB (height, width, 3)."""
    if message.encoding not in ("rgb8", "bgr8"):
        raise MessageError(f"image encoding '{message.encoding}' has no colour to find blocks by; send rgb8 or bgr8")
    pixels = _rows(message, 3)
    return pixels[:, :, ::-1] if message.encoding == "bgr8" else pixels


def read_grey_image(message: Image) -> NDArray[np.uint8]:
    """Read a mono8, rgb8 or bgr8 image, padded rows included, as grey levels (height, width)."""
    if message.encoding == "mono8":
        return _rows(message, 1)[:, :, 0]
    if message.encoding not in ("rgb8", "bgr8"):
        raise MessageError(f"image encoding '{message.encoding}' can't be read; send mono8, rgb8 or bgr8")
    weights = np.array([0.299, 0.587, 0.114])
    return np.asarray(np.rint(read_image(message) @ weights), np.uint8)


def _rows(message: Image, channels: int) -> NDArray[np.uint8]:
    height, width, step = int(message.height), int(message.width), int(message.step)
    if height < 1 or width < 1 or step < channels * width or len(message.data) < step * height:
        raise MessageError(
            f"image of {width} x {height}, step {step}, has {len(message.data)} bytes: cut off or mis-sized"
        )
    rows = np.frombuffer(message.data, dtype=np.uint8, count=step * height).reshape(height, step)
    return rows[:, : channels * width].reshape(height, width, channels)


def camera_info(
    width: int,
    height: int,
    focal_px: float,
    centre_px: tuple[float, float],
    frame: str,
    stamp_ns: int,
    distortion: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0),
) -> CameraInfo:
    """Make a camera's calibration; distortion is k1, k2, p1, p2, k3 of OpenCV's model."""
    cx, cy = centre_px
    message = CameraInfo(header=header(stamp_ns, frame), height=height, width=width, distortion_model="plumb_bob")
    message.d = list(distortion)
    message.k = [focal_px, 0.0, cx, 0.0, focal_px, cy, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [focal_px, 0.0, cx, 0.0, 0.0, focal_px, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


@lru_cache(maxsize=1)
def _block_fields() -> list[PointField]:
    fields = []
    for name in BLOCK_DTYPE.names or ():
        dtype, offset = BLOCK_DTYPE.fields[name][:2]  # type: ignore[index]
        fields.append(PointField(name=name, offset=offset, datatype=_POINT_FIELD_TYPES[dtype.str], count=1))
    return fields


def blocks(found: Sequence[Block], frame: str, stamp_ns: int) -> PointCloud2:
    """Make one point per block, in the image's frame and with its stamp; also when there is none."""
    rows = [(b.signature, b.x, b.y, b.width, b.height, b.angle, b.index, b.age) for b in found]
    size = BLOCK_DTYPE.itemsize
    return PointCloud2(
        header=header(stamp_ns, frame),
        height=1,
        width=len(rows),
        fields=_block_fields(),
        is_bigendian=False,
        point_step=size,
        row_step=size * len(rows),
        data=array.array("B", np.array(rows, dtype=BLOCK_DTYPE).tobytes()),
        is_dense=True,
    )


def read_blocks(message: PointCloud2) -> list[Block]:
    """Read blocks."""
    if list(message.fields) != _block_fields() or message.point_step != BLOCK_DTYPE.itemsize or message.is_bigendian:
        layout = ", ".join(f"{name} {BLOCK_DTYPE[name].name}" for name in BLOCK_DTYPE.names or ())
        names = ", ".join(field.name for field in message.fields) or "nothing"
        raise MessageError(f"blocks must have the packed little-endian fields {layout}; these have {names}")
    if len(message.data) != message.width * message.height * BLOCK_DTYPE.itemsize:
        raise MessageError(f"blocks of {message.width} points have {len(message.data)} bytes: cut off or mis-sized")
    points = np.frombuffer(message.data, dtype=BLOCK_DTYPE)
    return [Block(*(int(value) for value in point)) for point in points]


def diagnostics(name: str, level: int, text: str, values: Mapping[str, str], stamp_ns: int) -> DiagnosticArray:
    """Make a health report: level 0 OK, 1 warning, 2 error."""
    status = DiagnosticStatus(
        level=bytes([level]),
        name=name,
        message=text,
        hardware_id="robot_formation",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    return DiagnosticArray(header=header(stamp_ns), status=[status])


def surface_marker(
    vertices: NDArray[np.float64], colours: NDArray[np.float64], triangles: NDArray[np.int64], frame: str
) -> Marker:
    """Make a TRIANGLE_LIST of a mesh.

    Args:
        vertices: (n, 3), metres.
        colours: (n, 3), 0..1.
        triangles: (m, 3) indices of vertices.
        frame: the frame of the vertices.
    """
    marker = Marker(header=header(0, frame), ns="surface", id=0, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    corners = triangles.ravel()
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in vertices[corners].tolist()]
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in colours[corners].tolist()]
    marker.color.a = 1.0
    return marker
