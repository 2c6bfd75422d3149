"""ROS messages from the project's values and back. The only place outside nodes/ that knows message packages.

Readers check what comes from outside and raise `MessageError` before anything reaches a model or a wheel.
"""

from __future__ import annotations

from robot_formation.network.loading_ros import require_ros

require_ros()  # before the imports below load it

from robot_formation.conversions.basics import (  # noqa: E402
    as_message,
    clock,
    diagnostics,
    from_cdr,
    header,
    message_class,
    read_clock,
    stamp_of,
    string,
    to_cdr,
    to_ns,
    to_time,
    uint32,
)
from robot_formation.conversions.markers import (  # noqa: E402
    surface_marker,
)
from robot_formation.conversions.motion import (  # noqa: E402
    NO_ESTIMATE,
    PathPose,
    body_odometry,
    displacement,
    has_estimate,
    joint_command,
    joint_states,
    knows_turn,
    move,
    odometry,
    path,
    path_pose,
    place,
    planar_path_pose,
    pose,
    pose_array,
    read_covariance,
    read_displacement,
    read_joint_command,
    read_joint_states,
    read_move,
    read_planar_twist,
    read_pose,
)
from robot_formation.conversions.vision import (  # noqa: E402
    blocks,
    camera_info,
    image,
    read_grey_image,
)
from robot_formation.errors import MessageError  # noqa: E402
from robot_formation.vision.recorded_messages import (  # noqa: E402
    BLOCK_DTYPE,
    read_blocks,
    read_image,
)

__all__ = [
    "BLOCK_DTYPE",
    "NO_ESTIMATE",
    "MessageError",
    "PathPose",
    "as_message",
    "blocks",
    "body_odometry",
    "camera_info",
    "clock",
    "diagnostics",
    "displacement",
    "from_cdr",
    "has_estimate",
    "header",
    "image",
    "joint_command",
    "joint_states",
    "knows_turn",
    "message_class",
    "move",
    "odometry",
    "path",
    "path_pose",
    "place",
    "planar_path_pose",
    "pose",
    "pose_array",
    "read_blocks",
    "read_clock",
    "read_covariance",
    "read_displacement",
    "read_grey_image",
    "read_image",
    "read_joint_command",
    "read_joint_states",
    "read_move",
    "read_planar_twist",
    "read_pose",
    "stamp_of",
    "string",
    "surface_marker",
    "to_cdr",
    "to_ns",
    "to_time",
    "uint32",
]
