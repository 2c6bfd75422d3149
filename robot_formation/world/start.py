"""Where robots stand when a world begins."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.surface import Surface
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose, pose_on_surface


@dataclass(frozen=True)
class RobotStart:
    """Where a robot stands at time 0: name, base_link in the world (m, rad), and whether it carries a camera."""

    name: str
    x_m: float
    y_m: float
    heading_rad: float
    camera: bool = True

    def pose(self, surface: Surface, parameters: WorldParameters) -> Pose:
        """Pose of base_link with all wheels on the surface."""
        wheels = parameters.wheels
        return pose_on_surface(
            surface, self.x_m, self.y_m, self.heading_rad, wheelbase_m=wheels.wheelbase_m, track_m=wheels.track_m
        )
