"""The overhead camera of the world as messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robot_formation import conversions, names
from robot_formation.names import Message
from robot_formation.surface import Surface
from robot_formation.world.events import Event, RobotPose
from robot_formation.world.overhead import OverheadCamera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.world import World

Send = Callable[[names.Topic, Message], None]


class OverheadView:
    """Sends a picture at the start and whenever all robots have come to rest, if the camera is enabled."""

    def __init__(self, surface: Surface, parameters: WorldParameters, seed: int) -> None:
        self._camera = OverheadCamera(surface, parameters, seed) if parameters.overhead.enabled else None

    def topics(self) -> list[names.Topic]:
        """List what is sent."""
        return [names.OVERHEAD_IMAGE, names.OVERHEAD_INFO] if self._camera else []

    def announce(self, send: Send, stamp_ns: int) -> None:
        """Send the camera's true calibration."""
        if self._camera is None:
            return
        p = self._camera.parameters
        centre, distortion = (p.centre_x_px, p.centre_y_px), (p.k1, p.k2, p.p1, p.p2, p.k3)
        info = conversions.camera_info(
            p.width_px, p.height_px, p.focal_length_px, centre, names.OVERHEAD_FRAME, stamp_ns, distortion
        )
        send(names.OVERHEAD_INFO, info)

    def after(self, events: Sequence[Event], world: World, send: Send) -> None:
        """Render a picture if these events ended the last motion."""
        if self._camera is None or not world.at_rest:
            return
        if any(isinstance(event, RobotPose) and event.final for event in events):
            self.look(world, send)

    def look(self, world: World, send: Send) -> None:
        """Render a picture of the robots where they are now."""
        if self._camera is None:
            return
        poses = [world.ground_truth(robot).pose for robot in world.robots]
        picture = self._camera.frame(poses, world.step_count)
        send(names.OVERHEAD_IMAGE, conversions.image(picture, names.OVERHEAD_FRAME, world.stamp_ns))
