"""One simulated robot: its commanded motion, its rest and sleep, and what its encoders say."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from robot_formation.geometry.orientation import quaternion
from robot_formation.names import JOINTS
from robot_formation.surface import Surface
from robot_formation.world.body_and_traction import Body
from robot_formation.world.events import JointStates
from robot_formation.world.imperfections import draw_imperfections, generator
from robot_formation.world.parameters import DriveMode, WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.start import RobotStart
from robot_formation.world.wheel_motor import HELD

SETTLING_ROUNDS = 4


class Robot:
    """State machine of one robot: standing (asleep or not) or in a motion that ends at rest.

    Attributes:
        body: the rigid body with its wheels.
        moving: a motion isn't over; awake: the body takes part in the physics.
        disturbed: the motion is not a command's but comes from another body's touch.
        timed_out: the last motion was braked because it took too long.
        held: its reference dot has left the plate; it is held where it is and takes no commands.
    """

    def __init__(
        self, start: RobotStart, surface: Surface, parameters: WorldParameters, seed: int, client: int
    ) -> None:
        self.start = start
        self.name = start.name
        self.parameters = parameters
        self.moving = False
        self.disturbed = False
        self.awake = True
        self.timed_out = False
        self.held = False
        self._steps_moving = 0
        self._steps_resting = 0
        self._rest_steps = max(1, round(parameters.rest_time_s * parameters.physics_hz))
        self._rest_speed_square = parameters.rest_speed_m_s**2
        self._rest_rate_square = parameters.rest_rate_rad_s**2
        self._timeout_steps = round(parameters.motion_timeout_s * parameters.physics_hz)
        self._stop_stream = generator(seed, start.name, "motor stop")
        self._surface = surface
        self.body = Body(surface, parameters, draw_imperfections(parameters.imperfections, seed, start.name), client)
        self._first_pose = start.pose(surface, parameters)
        self.body.place(self._first_pose)

    def settle(self, step: Callable[[], None]) -> None:
        """Let the robot settle on its wheels and their contact springs, then put it back to the asked place, at rest.

        Args:
            step: makes one physics step.
        """
        start, body = self.start, self.body
        pose = self._first_pose
        for _ in range(SETTLING_ROUNDS):
            body.place(pose)
            self._steps_resting = 0
            for _ in range(self.parameters.physics_hz):
                body.apply_ground_forces()
                step()
                if self._rests():
                    break
            found = body.pose()
            x, y, z = found.position
            slope_x, slope_y = self._surface.gradient(x, y)
            pose = Pose(
                (start.x_m, start.y_m, z + slope_x * (start.x_m - x) + slope_y * (start.y_m - y)),
                quaternion(found.roll_rad, found.pitch_rad, start.heading_rad),
            )
        body.place(pose)
        body.encoder_angles = [0.0, 0.0]
        self.awake = not self.parameters.sleep

    def begin(self, angles: Sequence[float], speeds: Sequence[float]) -> None:
        """Start (or replace) a motion; the values have been checked."""
        self.moving = True
        self.disturbed = False
        self.timed_out = False
        self._steps_moving = 0
        self._steps_resting = 0
        top = max((speed for angle, speed in zip(angles, speeds, strict=True) if angle != 0.0), default=0.0)
        for wheel in self.body.wheels:
            wheel.brake()
        if top == 0.0:
            return
        self.awake = True
        motor = self.parameters.motor
        lateness = self._draw_lateness() if motor.drive_mode is DriveMode.PWM_STOP else (0.0,) * 5
        for wheel, angle, speed, own in zip(self.body.wheels, angles, speeds, lateness[1:], strict=True):
            if angle == 0.0:
                continue
            share = speed / top
            if motor.drive_mode is DriveMode.PWM_STOP:
                wheel.start_pwm(angle, speed, lateness[0] * share + own)
            else:
                wheel.start_pid(angle, speed, motor.acceleration_rad_s2 * share)

    def _draw_lateness(self) -> tuple[float, ...]:
        """Late (or early) stops in radians: one for the whole move, as by a polling loop, and one per wheel."""
        flaws = self.parameters.imperfections
        radius = self.parameters.wheels.radius_m
        common, *own = (float(value) for value in self._stop_stream.standard_normal(5))
        return (common * flaws.stop_common_m / radius, *(value * flaws.stop_wheel_m / radius for value in own))

    def brake(self) -> None:
        """Abort the running motion."""
        for wheel in self.body.wheels:
            wheel.brake()

    def hold(self) -> None:
        """Fix the pose: the robot has left the plate."""
        for wheel in self.body.wheels:
            wheel.hold()
        self.body.freeze()
        self.moving = self.awake = False
        self.held = True

    def disturb(self) -> None:
        """Wake up because something touched the robot."""
        self.awake = True
        if not self.moving:
            self.begin((0.0,) * 4, (0.0,) * 4)
            self.disturbed = True

    def _rests(self) -> bool:
        """Whether wheels and body have been slow for long enough; counts the steps."""
        for wheel in self.body.wheels:
            if wheel.state != HELD:
                self._steps_resting = 0
                return False
        linear, angular = self.body.speed_squares()
        self._steps_resting = self._steps_resting + 1 if self._slow(linear, angular) else 0
        return self._steps_resting >= self._rest_steps

    def _slow(self, linear: float, angular: float) -> bool:
        """Whether squares of speed and turning rate count as rest."""
        return linear < self._rest_speed_square and angular < self._rest_rate_square

    def finished(self) -> bool:
        """Count one step of the motion; True when it is over (then the robot sleeps, if it may)."""
        self._steps_moving += 1
        if self._steps_moving == self._timeout_steps:
            self.timed_out = True
            self.brake()
        # A robot that slides on with standing wheels is given up a second after the timeout.
        given_up = self._steps_moving >= self._timeout_steps + self.parameters.physics_hz
        if self.awake and not self._rests() and not given_up:
            return False
        self.moving = False
        if self.parameters.sleep:
            self.body.freeze()
            self.awake = False
        return True

    def pushed(self) -> bool:
        """Whether another body has just pushed a sleeping robot hard enough to wake it.

        A lighter touch is held by its tyres. Without this limit two robots that press against each other would wake
        each other for ever.
        """
        linear, angular = self.body.speed_squares()
        if linear == angular == 0.0:
            return False
        if self.held or self._slow(linear, angular):
            self.body.freeze()
            return False
        self.body.read_pose()
        return True

    def joint_states(self, stamp_ns: int, *, final: bool) -> JointStates:
        """What the encoders say; velocities are zero in the final one."""
        pulse = 2.0 * math.pi / self.parameters.encoder_wheels.pulses_per_turn
        positions = tuple(wheel.measured_angle() for wheel in self.body.wheels) + tuple(
            pulse * math.floor(angle / pulse + 0.5) for angle in self.body.encoder_angles
        )
        speeds = tuple(wheel.speed for wheel in self.body.wheels) + tuple(self.body.encoder_speeds)
        return JointStates(
            self.name, stamp_ns, JOINTS, positions, (0.0,) * 6 if final else speeds, final, self.timed_out
        )
