"""Drive: a robot's movement and sensing system."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.drive.curves import calibrated
from robot_formation.drive.movement_system import Drive, DriveAction, DriveParameters
from robot_formation.names import Message
from robot_formation.parameters import ParameterError

# Encoder wheels: half a pulse of 0.233 mm and 0.3 % of 5 cm, rounded up, as one standard deviation each way.
_VARIANCE_M2 = (0.0002**2, 0.0, 0.0, 0.0002**2)


class DriveComponent(Component):
    """Turns `move` into `joint_commands` and `joint_states` into `moved` and `odom`."""

    fixed: ClassVar[Mapping[str, str]] = {}

    def __init__(self, parameters: DriveParameters, place: Place) -> None:
        super().__init__(place)
        self._drive = Drive(calibrated(parameters, place.robot))
        self._calibration = parameters.calibration_file or "by parameters"
        self._last: Callable[[Drive], Any] = lambda drive: None
        listener = "leader" if place.robot == names.LEADER else "fine_tuner"
        self._moved = replace(names.MOVED, listeners=(listener,))

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [Input(names.MOVE, self._on_move), Input(names.joint_states(), self._on_joint_states)]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [names.joint_commands(), self._moved, names.ODOM]

    def services(self) -> dict[str, Callable[[], tuple[bool, str]]]:
        """See `Component`."""
        return {"drive/stop": self._on_stop}

    def set_parameters(self, parameters: DriveParameters) -> None:
        """See `Component`: taken between moves; odometry goes on.

        Raises:
            ParameterError: while a move is under way.
            CalibrationError: if the calibration file can't be used.
        """
        if self._drive.busy:
            raise ParameterError("drive: a move is under way; set parameters after 'moved'")
        drive = Drive(calibrated(parameters, self.place.robot))
        drive.odometry = self._drive.odometry
        self._last(drive)  # where the joints stand
        self._drive = drive
        self._calibration = parameters.calibration_file or "by parameters"

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {"moving": str(self._drive.busy), "calibration": self._calibration}

    def _on_move(self, message: Message) -> None:
        self.stamp_ns = max(self.stamp_ns, conversions.stamp_of(message))
        self._act(self._drive.move(conversions.read_move(message)))

    def _on_joint_states(self, message: Message) -> None:
        try:
            positions, velocities = conversions.read_joint_states(message)
        except conversions.MessageError as error:
            self.warn(str(error))
            return
        self.stamp_ns = stamp_ns = conversions.stamp_of(message)
        number = message.header.frame_id
        self._last = lambda drive: drive.joint_states(stamp_ns, positions, velocities, number)
        self._act(self._last(self._drive))

    def _on_stop(self) -> tuple[bool, str]:
        action = self._drive.stop()
        self._act(action)
        return action.command is not None, action.warning

    def _act(self, action: DriveAction) -> None:
        if action.warning:
            self.warn(action.warning)
        if action.command is not None:
            self._send(names.joint_commands(), conversions.joint_command(action.command, self.stamp_ns))
        if action.moved is not None:
            base = self.place.frame(names.BASE_FRAME)
            odom = self.place.frame(names.ODOM_FRAME)
            self._send(names.ODOM, conversions.odometry(self._drive.odometry, odom, base, self.stamp_ns))
            self._send(self._moved, conversions.displacement(action.moved, base, self.stamp_ns, _VARIANCE_M2))
