"""Simulated robots and cameras on a surface: bodies, traction, motors, encoders, pictures, and the rule of time."""

from robot_formation.world.camera import Camera, Picture
from robot_formation.world.checks import WorldError
from robot_formation.world.events import BodyState, Event, Frame, JointStates, LeftPlate, RobotPose
from robot_formation.world.marker_picture import marker_picture
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface
from robot_formation.world.robot import RobotStart
from robot_formation.world.sensor import Development, Sensor
from robot_formation.world.state import WorldState
from robot_formation.world.world import World

__all__ = [
    "BodyState",
    "Camera",
    "Development",
    "Event",
    "Frame",
    "JointStates",
    "LeftPlate",
    "Picture",
    "Pose",
    "RobotPose",
    "RobotStart",
    "Sensor",
    "World",
    "WorldError",
    "WorldParameters",
    "WorldState",
    "marker_picture",
    "pose_on_surface",
]
