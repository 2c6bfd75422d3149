"""A robot's movement and sensing system: distances to wheel rotations, encoder wheels to displacement.

A preset distance becomes wheel rotations through a calibration curve per axis (paper, "Movement system calibrations": v
up to 20 cm, u up to 10 cm). A move along several axes is driven as legs, one axis after the other in the order turn, v,
u, because the curves hold along an axis. The realised displacement comes from the two encoder wheels (paper, "Sensing
system").
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

from robot_formation.geometry.se2 import Motion
from robot_formation.names import JOINTS
from robot_formation.parameters import parameter

LEG_SIGNS = {"yaw": (-1.0, 1.0, -1.0, 1.0), "x": (1.0, 1.0, 1.0, 1.0), "y": (-1.0, 1.0, 1.0, -1.0)}
"""Rotation of front left, front right, rear left, rear right per unit of a leg: mecanum kinematics, rollers in X."""


@dataclass(frozen=True)
class CalibrationParameters:
    """Wheel rotation [rad] as a polynomial of the distance asked for; constant term first, odd in the distance's sign.

    A negative constant term is what the robot coasts after its motors were switched off.
    """

    v: tuple[float, ...] = parameter((-0.084, 33.3257), "Curve along v: rad, rad/m, rad/m^2, ...")
    u: tuple[float, ...] = parameter((-0.074, 33.4589), "Curve along u: rad, rad/m, rad/m^2, ...")
    turn: tuple[float, ...] = parameter((-0.0657, 6.8361), "Curve of turns: rad, rad/rad, rad/rad^2, ...")


@dataclass(frozen=True)
class DriveParameters:
    """Calibration, range and sensing of one robot's drive."""

    calibration: CalibrationParameters = CalibrationParameters()
    calibration_file: str = parameter(
        "", "YAML file of 'formation calibrate motors': this robot's curves in it go before 'calibration'; empty: none"
    )
    max_v_m: float = parameter(0.2, "Calibrated range along v; longer moves are refused", unit="m", low=0.0, high=10.0)
    max_u_m: float = parameter(0.1, "Calibrated range along u; longer moves are refused", unit="m", low=0.0, high=10.0)
    max_turn_rad: float = parameter(1.1, "Calibrated range of turns", unit="rad", low=0.0, high=6.3)
    wheel_speed_rad_s: float = parameter(4.0, "Speed limit sent with every rotation", unit="rad/s", low=0.1, high=100.0)
    wheel_radius_m: float = parameter(0.03, "Nominal radius of the drive wheels", unit="m", low=0.001, high=1.0)
    wheel_lever_m: float = parameter(0.205, "Half wheelbase plus half track", unit="m", low=0.001, high=10.0)
    encoder_radius_m: float = parameter(0.019, "Radius of the encoder wheels", unit="m", low=0.001, high=1.0)
    encoder_v_offset_m: float = parameter(-0.03, "y of the v encoder wheel in base_link", unit="m", low=-1.0, high=1.0)
    encoder_u_offset_m: float = parameter(-0.05, "x of the u encoder wheel in base_link", unit="m", low=-1.0, high=1.0)
    move_timeout_s: float = parameter(
        20.0, "Simulated time after which a leg is stopped", unit="s", low=0.1, high=600.0
    )


@dataclass(frozen=True)
class WheelCommand:
    """Relative rotations [rad] of the four drive wheels and their speed limits [rad/s].

    The number is echoed in the joints' reports, so that the end of an earlier command isn't taken for that of a later.
    """

    angles_rad: tuple[float, ...]
    limits_rad_s: tuple[float, ...]
    number: str = ""


@dataclass(frozen=True)
class DriveAction:
    """What to send now: the next leg's rotations or the finished move's displacement; a warning with either."""

    command: WheelCommand | None = None
    moved: Motion | None = None
    warning: str = ""


class Drive:
    """State machine of one robot's drive: at most one move at a time."""

    def __init__(self, parameters: DriveParameters) -> None:
        self._parameters = parameters
        self._legs: deque[WheelCommand] = deque()
        self._busy = False
        self._realised = Motion()
        self._reference: tuple[float, ...] | None = None  # joint positions at the leg's start
        self._leg_start_ns: int | None = None
        self._stopping = False
        self._number = 0
        self.odometry = Motion()

    @property
    def busy(self) -> bool:
        """Whether a move is under way."""
        return self._busy

    def move(self, target: Motion) -> DriveAction:
        """Start a move. One that can't be driven becomes a hold and a warning, so that it is answered too."""
        if self._busy:
            return DriveAction(warning="a move is under way: the new one is dropped; wait for 'moved'")
        reason = self._refusal(target)
        legs = [] if reason else self._plan(target)
        self._legs = deque(legs or [self._hold()])
        self._busy = True
        self._stopping = False
        self._realised = Motion()
        return DriveAction(command=self._numbered(self._next_leg()), warning=reason)

    def stop(self) -> DriveAction:
        """Brake now: the rest of the move is given up; `moved` reports what was driven."""
        if not self._busy:
            return DriveAction(warning="nothing to stop: the robot stands")
        self._legs.clear()
        self._stopping = True
        return DriveAction(command=self._numbered(self._hold()), warning="stopped on request")

    def joint_states(
        self, stamp_ns: int, positions: Sequence[float], velocities: Sequence[float], number: str = ""
    ) -> DriveAction:
        """Process the six joints' positions [rad] and velocities [rad/s]; all velocities zero means at rest.

        Joints are ordered as `names.JOINTS`. Non-finite values must have been refused before. `number` is that of the
        command that the report answers; a robot whose firmware doesn't tell leaves it empty.
        """
        if self._reference is None:
            # Joints count from zero at the start of the world, so the first report needs no earlier one.
            self._reference = (0.0,) * len(JOINTS)
        if not self._busy:
            self._reference = tuple(positions)
            return DriveAction()
        if any(velocity != 0.0 for velocity in velocities):
            return self._check_timeout(stamp_ns)
        if number not in ("", str(self._number)):
            return DriveAction()  # the end of a motion that a later command has replaced
        self._realised = self._realised.then(self._displacement(self._reference, positions))
        self._reference = tuple(positions)
        if self._legs:
            return DriveAction(command=self._numbered(self._next_leg()))
        self._busy = False
        self.odometry = self.odometry.then(self._realised)
        return DriveAction(moved=self._realised)

    def _check_timeout(self, stamp_ns: int) -> DriveAction:
        if self._leg_start_ns is None:
            self._leg_start_ns = stamp_ns
        timeout_s = self._parameters.move_timeout_s
        if self._stopping or (stamp_ns - self._leg_start_ns) < timeout_s * 1e9:
            return DriveAction()
        self._legs.clear()
        self._stopping = True
        warning = f"a leg took longer than {timeout_s} s: stopped; is the robot blocked?"
        return DriveAction(command=self._numbered(self._hold()), warning=warning)

    def _numbered(self, command: WheelCommand) -> WheelCommand:
        self._number += 1
        return replace(command, number=str(self._number))

    def _refusal(self, target: Motion) -> str:
        p = self._parameters
        if not target.finite:
            return "refused a move that is not finite"
        turn, forward, left = target.legs
        for name, value, limit in (
            ("v", abs(forward), p.max_v_m),
            ("u", abs(left), p.max_u_m),
            ("turn", abs(turn), p.max_turn_rad),
        ):
            if value > limit:
                return f"refused a move of {value:.3f} in {name}: beyond the calibrated range of {limit}"
        return ""

    def _plan(self, target: Motion) -> list[WheelCommand]:
        curves = self._parameters.calibration
        turn, forward, left = target.legs
        legs = []
        for axis, amount, curve in (
            ("yaw", turn, curves.turn),
            ("x", forward, curves.v),
            ("y", left, curves.u),
        ):
            angle = sum(c * abs(amount) ** power for power, c in enumerate(curve)) if amount else 0.0
            if angle > 0.0:  # a leg shorter than the robot's coasting can't be driven
                angles = tuple(math.copysign(angle, amount) * sign for sign in LEG_SIGNS[axis])
                legs.append(WheelCommand(angles, (self._parameters.wheel_speed_rad_s,) * 4))
        return legs

    def _hold(self) -> WheelCommand:
        return WheelCommand((0.0,) * 4, (self._parameters.wheel_speed_rad_s,) * 4)

    def _next_leg(self) -> WheelCommand:
        self._leg_start_ns = None
        return self._legs.popleft()

    def _displacement(self, before: Sequence[float], after: Sequence[float]) -> Motion:
        """Displacement of base_link from the joints' differences; the turn comes from the drive wheels.

        A point at (px, py) moves by x - yaw py and y + yaw px, so the encoder wheels' offsets are taken out.
        """
        p = self._parameters
        fl, fr, rl, rr, forward, left = (b - a for a, b in zip(before, after, strict=True))
        yaw = p.wheel_radius_m * (fr + rr - fl - rl) / (4.0 * p.wheel_lever_m)
        return Motion(
            forward * p.encoder_radius_m + yaw * p.encoder_v_offset_m,
            left * p.encoder_radius_m - yaw * p.encoder_u_offset_m,
            yaw,
        )
