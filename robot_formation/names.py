"""Every topic, frame, joint and quality of service in one place.

Names are relative: a robot's nodes run in the robot's namespace, the world and the recorder in the one that the robots'
lie in, the formation's. The done ticks lie under the parameter `formation_namespace`, by default `formation` there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, TypeAlias

from robot_formation.errors import FormationError

Message: TypeAlias = Any
"""A ROS message: ROS generates the classes, and they carry no types."""

LEADER = "leader"
RECORDER = "recorder"
"""Name of the node that writes the bag."""
PROGRESS = "progress"
"""Name of the node that tells the progress of a launched run."""
VIEWER = "viewer"
"""Name of the node that shows a run in a browser."""
ONLOOKERS = frozenset({PROGRESS, VIEWER})
"""Nodes that listen, and nothing of a run needs them."""
FORMATION = "/formation"
PAUSED = "paused"
"""Key of the diagnostics by which the world tells whether it is paused."""

WORLD_FRAME = "world"
BASE_FRAME = "base_link"
ODOM_FRAME = "odom"
OPTICAL_FRAME = "camera_optical_frame"
OVERHEAD_FRAME = "overhead_camera_optical_frame"

IMAGE_TYPE = "sensor_msgs/msg/Image"

WHEELS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
ENCODER_WHEELS = ("encoder_wheel_v", "encoder_wheel_u")
"""encoder_wheel_v counts up along +x of base_link, encoder_wheel_u along +y."""
JOINTS = WHEELS + ENCODER_WHEELS
"""A robot's joints in the order of positions and velocities."""


@dataclass(frozen=True)
class Qos:
    """Quality of service by its ROS names; nothing inside a run may be dropped, hence reliable and keep_all."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_all"
    depth: int = 0


EVENT = Qos()
# Transient local: late subscribers get the whole history, or what is left of it.
HISTORY = Qos(durability="transient_local")
LATCHED = Qos(durability="transient_local", history="keep_last", depth=1)
# For paths, each of which replaces the one before. Of one alone a busy recorder would miss some.
GROWING = Qos(durability="transient_local", history="keep_last", depth=10)
# So many instants of a fast run take a second of wall time.
CLOCK = Qos(history="keep_last", depth=1000)
STATUS = Qos(history="keep_last", depth=10)


@dataclass(frozen=True)
class Topic:
    """A topic: name (relative or absolute), message type, QoS, and the nodes that must hear its first message.

    That message is held back until nodes of these names have subscribed, so that it is not lost to discovery.
    """

    name: str
    type: str
    qos: Qos = EVENT
    listeners: tuple[str, ...] = ()

    def of(self, robot: str = "") -> str:
        """Return the full name of a robot's topic ('': the formation's own), where the formation lies in the root."""
        return absolute(f"/{robot}", self.name)


def follower(number: int) -> str:
    """Return the name of the n-th follower, counted from 1."""
    return f"follower_{number}"


def follower_number(robot: str) -> int:
    """Return a follower's number, from 1."""
    return int(robot.rpartition("_")[2])


def beacon_neighbour(robot: str) -> str:
    """Return the name of the robot on a follower's left, which it keeps its place beside.

    Raises:
        FormationError: if the robot is no follower.
    """
    number = robot.removeprefix("follower_")
    if not re.fullmatch("follower_[1-9][0-9]*", robot):
        raise FormationError(f"'{robot}' is no follower: followers are called follower_1, follower_2, ...")
    return LEADER if number == "1" else follower(int(number) - 1)


def moved(robot: str) -> Topic:
    """Realised displacement of a robot's move."""
    return Topic(under(robot, MOVED.name), MOVED.type, MOVED.qos)


def alignment(robot: str) -> Topic:
    """State of a follower's alignment."""
    return Topic(under(robot, ALIGNMENT.name), ALIGNMENT.type, ALIGNMENT.qos)


def right_neighbour(robot: str) -> str:
    """Return the name of the follower on a robot's right, whether there is one or not."""
    return follower(1 if robot == LEADER else int(robot.removeprefix("follower_")) + 1)


def under(prefix: str, name: str) -> str:
    """Join a robot's name (may be empty: the node's own namespace) and a topic."""
    return f"{prefix}/{name}" if prefix else name


def absolute(namespace: str, name: str) -> str:
    """Return the full name of a topic or namespace: in a namespace ('' or '/': the root), unless it is absolute."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def joint_commands(robot: str = "") -> Topic:
    """Relative wheel rotations for a robot (drive to world)."""
    return Topic(under(robot, "joint_commands"), "sensor_msgs/msg/JointState", listeners=("world",))


def joint_states(robot: str = "") -> Topic:
    """Wheels and encoder wheels of a robot (world to drive)."""
    return Topic(under(robot, "joint_states"), "sensor_msgs/msg/JointState", listeners=("drive",))


def camera_request(robot: str = "") -> Topic:
    """Number of frames wanted (fine_tuner to world)."""
    return Topic(under(robot, "camera/request"), "std_msgs/msg/UInt32", listeners=("world",))


def camera_image(robot: str = "") -> Topic:
    """A camera's picture (world to block_detector)."""
    return Topic(under(robot, "camera/image_raw"), IMAGE_TYPE, listeners=("block_detector",))


def camera_info(robot: str = "") -> Topic:
    """A camera's calibration."""
    return Topic(under(robot, "camera/camera_info"), "sensor_msgs/msg/CameraInfo", LATCHED)


def ground_truth_odom(robot: str) -> Topic:
    """True pose and velocity of base_link in the world."""
    return Topic(f"ground_truth/{robot}/odom", "nav_msgs/msg/Odometry")


def ground_truth_pose(robot: str) -> Topic:
    """True pose of base_link at rest, for viewers."""
    return Topic(f"ground_truth/{robot}/pose", "geometry_msgs/msg/PoseStamped", HISTORY)


def ground_truth_path(robot: str) -> Topic:
    """True path of base_link at rest, for viewers."""
    return Topic(f"ground_truth/{robot}/path", "nav_msgs/msg/Path", GROWING)


def left_plate() -> Topic:
    """Name of the robot whose reference dot has left the plate."""
    return Topic("ground_truth/left_plate", "std_msgs/msg/String", HISTORY)


def robot_description(robot: str) -> Topic:
    """A robot's URDF, for viewers; link names are without the robot's name."""
    return Topic(under(robot, "robot_description"), "std_msgs/msg/String", LATCHED)


def overhead_path(robot: str) -> Topic:
    """Where the overhead camera has seen a robot's reference dot so far."""
    return Topic(f"overhead/{robot}/path", "nav_msgs/msg/Path", GROWING)


def formation_done(robot: str, formation: str = FORMATION, *, listeners: tuple[str, ...] = ("fine_tuner",)) -> Topic:
    """The bare tick of a robot: the number of the timestep that it has finished."""
    return Topic(f"{formation}/{robot}/done", "std_msgs/msg/UInt32", HISTORY, listeners)


def formation_begun(robot: str, formation: str = FORMATION, *, listeners: tuple[str, ...] = ("world",)) -> Topic:
    """The bare tick of a robot in the schedule `together`: the number of the timestep that it begins.

    0 says of a follower that it has finished its first alignment.
    """
    return Topic(f"{formation}/{robot}/begun", "std_msgs/msg/UInt32", HISTORY, listeners)


def formation_clock(home: str = "") -> Topic:
    """The world's clock, for the schedule `timer`; `home` is the namespace in which world and robots lie."""
    return Topic(absolute(home, CLOCK_TOPIC.name), "rosgraph_msgs/msg/Clock", CLOCK)


SURFACE = Topic("surface", "visualization_msgs/msg/Marker", LATCHED)
OVERHEAD_IMAGE = Topic("overhead/image_raw", IMAGE_TYPE, listeners=("overhead_tracker",))
OVERHEAD_INFO = Topic("overhead/camera_info", "sensor_msgs/msg/CameraInfo", LATCHED)
OVERHEAD_POSES = Topic("overhead/poses", "geometry_msgs/msg/PoseArray")
CLOCK_TOPIC = Topic("clock", "rosgraph_msgs/msg/Clock", CLOCK)
# The one that nodes with use_sim_time hear, wherever they are.
ROS_CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", CLOCK)
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", STATUS)
MOVE = Topic("move", "geometry_msgs/msg/PoseStamped", listeners=("drive",))
PLAN = Topic("plan", "nav_msgs/msg/Path", LATCHED)
# A person's commands come from outside the run, at any rate, and only the newest counts.
CMD_VEL = Topic("cmd_vel", "geometry_msgs/msg/TwistStamped", Qos(history="keep_last", depth=1))
CMD_VEL_UNSTAMPED = Topic("cmd_vel_unstamped", "geometry_msgs/msg/Twist", Qos(history="keep_last", depth=1))
MOVED = Topic("moved", "geometry_msgs/msg/PoseWithCovarianceStamped", HISTORY, ())
ODOM = Topic("odom", "nav_msgs/msg/Odometry")
BLOCKS = Topic("blocks", "sensor_msgs/msg/PointCloud2", listeners=("fine_tuner",))
BLOCKS_IMAGE = Topic("blocks/image", IMAGE_TYPE)
DISPLACEMENT = Topic("displacement", "geometry_msgs/msg/PoseWithCovarianceStamped", HISTORY, ("predictor",))
RESIDUAL = Topic("residual", "geometry_msgs/msg/PoseWithCovarianceStamped", HISTORY, ("predictor",))
COMMANDED = Topic("commanded", "geometry_msgs/msg/PoseWithCovarianceStamped", HISTORY, ("predictor",))
PREDICTION = Topic("prediction", "geometry_msgs/msg/PoseWithCovarianceStamped", HISTORY, ("fine_tuner",))
FORECAST = Topic("forecast", "geometry_msgs/msg/PoseWithCovarianceStamped", HISTORY, ("fine_tuner",))
ALIGNMENT = Topic("alignment", "std_msgs/msg/String", HISTORY)
# Made of ground truth and robot descriptions: by the world where tf2_msgs is installed (it is not on pip), else by the
# recorder. In the formation's namespace, since formations have frames of the same names.
TF = Topic("tf", "tf2_msgs/msg/TFMessage")
TF_STATIC = Topic("tf_static", "tf2_msgs/msg/TFMessage", LATCHED)
