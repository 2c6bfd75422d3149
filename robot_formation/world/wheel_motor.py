"""One driven wheel: motor, gear, encoder and the firmware that turns it by a commanded angle."""

from __future__ import annotations

import math

from robot_formation.world.parameters import DriveMode, MotorParameters

HELD = 0
DRIVING = 1
BRAKING = 2
_HOLD_SPEED_RAD_S = 0.3
"""Static friction of the gear stops a shorted motor below this speed; what it would still turn is 0.05 mm of travel."""


class Wheel:
    """A mecanum wheel with its motor; the traction law of `Body` reads and writes its fields.

    Attributes:
        x, y, z: wheel centre from the centre of mass, body axes, metres.
        side: +1 or -1, the sense of the rollers: the ground holds it along (forward + side * left) / sqrt(2).
        rolling_radius: metres travelled per radian.
        angle: radians turned since the start; speed: rad/s.
        bristle: deflection of the contact, metres.
        state: HELD (the gear can't be driven back), DRIVING or BRAKING (motor shorted).
    """

    __slots__ = (
        "_count",
        "_damping",
        "_friction",
        "_integral",
        "_p",
        "_per_inertia",
        "_profile",
        "_pwm",
        "_settled",
        "_start",
        "_stop_at",
        "_time",
        "angle",
        "bristle",
        "direction",
        "drive",
        "gain",
        "rolling_radius",
        "side",
        "speed",
        "state",
        "x",
        "y",
        "z",
    )

    def __init__(
        self,
        parameters: MotorParameters,
        centre: tuple[float, float, float],
        side: float,
        radius: float,
        gain: float,
        dt: float,
    ) -> None:
        self._p = parameters
        self._pwm = parameters.drive_mode is DriveMode.PWM_STOP
        self._per_inertia = dt / parameters.inertia_kg_m2
        self._damping = 1.0 + self._per_inertia * parameters.back_emf_n_m_s
        self._friction = self._per_inertia * parameters.friction_n_m / self._damping
        self.x, self.y, self.z = centre
        self.side = side
        self.rolling_radius = radius
        self.gain = gain
        self.angle = 0.0
        self.speed = 0.0
        self.bristle = 0.0
        self.state = HELD
        self.drive = 0.0
        self.direction = 1.0
        self._count = 2.0 * math.pi / parameters.counts_per_turn
        self._start = 0.0
        self._stop_at = 0.0
        self._profile = (0.0, 0.0, 0.0)
        self._integral = 0.0
        self._time = 0.0
        self._settled = 0

    def measured_angle(self) -> float:
        """Angle in whole encoder counts, radians."""
        return self._count * math.floor(self.angle / self._count + 0.5)

    def brake(self) -> None:
        """Short the motor unless the wheel is held already."""
        if self.state == DRIVING:
            self.state = BRAKING

    def hold(self) -> None:
        """Stop the wheel on the spot."""
        self.speed = 0.0
        self.state = HELD

    def start_pwm(self, angle: float, speed: float, late: float) -> None:
        """Turn by `angle` rad with the PWM of no-load speed `speed` rad/s, stopping `late` rad after the count."""
        self.direction = 1.0 if angle > 0.0 else -1.0
        self._start = self.angle
        self._stop_at = self._count * math.ceil(max(0.0, abs(angle) + late) / self._count)
        self.drive = self.direction * self.gain * (self._p.back_emf_n_m_s * speed + self._p.friction_n_m)
        self.state = DRIVING

    def start_pid(self, angle: float, speed: float, acceleration: float) -> None:
        """Turn by `angle` rad along a trapezoid of `speed` rad/s and `acceleration` rad/s^2, then settle."""
        self.direction = 1.0 if angle > 0.0 else -1.0
        self._start = self.angle
        length = abs(angle)
        top = min(speed, math.sqrt(length * acceleration))
        self._profile = (length, top, acceleration)
        self._integral = self._time = 0.0
        self._settled = 0
        self.state = DRIVING

    def control(self, dt: float) -> None:
        """Firmware's turn, once per physics step while DRIVING: sets the motor torque or brakes."""
        if self._pwm:
            if self.direction * (self.angle - self._start) >= self._stop_at:
                self.state = BRAKING
            return
        self._time += dt
        length, top, acceleration = self._profile
        target, rate = _trapezoid(self._time, length, top, acceleration)
        measured = self._count * round((self.angle - self._start) / self._count)
        error = self.direction * target - measured
        rate *= self.direction
        end = length / top + top / acceleration
        if self._time >= end:
            self._settled = self._settled + 1 if abs(error) <= self._count else 0
            if self._settled >= 6 or self._time >= end + self._p.pid_settle_s:
                self.state = BRAKING
                return
        p = self._p
        self._integral += error * dt
        sense = rate if rate != 0.0 else error
        friction = math.copysign(p.friction_n_m, sense) if abs(sense) > 1e-9 else 0.0
        torque = (
            p.pid_p * error
            + p.pid_i * self._integral
            + p.pid_d * (rate - self.speed)
            + p.back_emf_n_m_s * rate
            + friction
        )
        stall = p.back_emf_n_m_s * p.max_speed_rad_s + p.friction_n_m
        self.drive = self.gain * max(-stall, min(stall, torque))

    def turn(self, load: float, dt: float) -> None:
        """Advance the shaft by one step, implicit in speed, under the ground's torque `load` (N m)."""
        if self.state == HELD:
            return
        drive = self.drive if self.state == DRIVING else 0.0
        free = (self.speed + self._per_inertia * (drive + load)) / self._damping
        friction = self._friction
        if free > friction:
            speed = free - friction
        elif free < -friction:
            speed = free + friction
        else:
            speed = 0.0
        if self.state == BRAKING and (speed * self.speed <= 0.0 or abs(speed) < _HOLD_SPEED_RAD_S):
            # The gear can't be driven back: once the wheel stands, or all but stands, it stays.
            speed = 0.0
            self.state = HELD
        self.speed = speed
        self.angle += dt * speed


def _trapezoid(time: float, length: float, top: float, acceleration: float) -> tuple[float, float]:
    """Position and speed at `time` of a move of `length` with trapezoidal speed."""
    ramp = top / acceleration
    cruise = length / top - ramp
    if time < ramp:
        return 0.5 * acceleration * time * time, acceleration * time
    if time < ramp + cruise:
        return top * (time - 0.5 * ramp), top
    left = 2.0 * ramp + cruise - time
    if left <= 0.0:
        return length, 0.0
    return length - 0.5 * acceleration * left * left, acceleration * left
