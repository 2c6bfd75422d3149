"""A robot's rigid body, carried and driven by four analytic wheel contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from robot_formation.geometry.orientation import Vector, rotate
from robot_formation.surface import Surface
from robot_formation.surface.paraboloid import Paraboloid
from robot_formation.world.bullet import pybullet
from robot_formation.world.events import BodyState
from robot_formation.world.imperfections import Imperfections
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.wheel_motor import DRIVING, HELD, Wheel

HALF_ROOT = math.sqrt(0.5)
ROLLER_DRAG_SPEED = 0.005
"""Slip speed (m/s) at which the roller drag has half its strength."""

# Called for every robot in every step; PyBullet reads positional arguments faster than named ones.
_read_pose = pybullet.getBasePositionAndOrientation
_read_velocity = pybullet.getBaseVelocity
_apply_force = pybullet.applyExternalForce
_apply_torque = pybullet.applyExternalTorque
_WORLD_FRAME = pybullet.WORLD_FRAME


class TractionLaw(NamedTuple):
    """Constants of the contact of a wheel with the ground, as one tuple for the hot loop.

    Attributes:
        stiffness_n_m: of the contact along the normal.
        damping_n_s_m: of the contact along the normal.
        friction: largest share of the load that the roller's axis holds.
        roller_drag: share of the load by which the roller resists rolling off.
        bristle_stiffness_n_m: along the roller's axis.
        bristle_damping_n_s_m: along the roller's axis.
        relaxation_m: way driven in which the bristle forgets its deflection.
        contact_radius_m: from a wheel's centre to the ground.
        twist_softness_n_m: how much less stiff the wheels are against the frame's twist.
        twist_travel_m: farthest twist.
    """

    stiffness_n_m: float
    damping_n_s_m: float
    friction: float
    roller_drag: float
    bristle_stiffness_n_m: float
    bristle_damping_n_s_m: float
    relaxation_m: float
    contact_radius_m: float
    twist_softness_n_m: float
    twist_travel_m: float


class Body:
    """Rigid Bullet body without ground contact of its own; the traction law gives the ground's forces.

    The contact is LuGre-like: a bristle per wheel along its roller axis, that holds at rest and forgets its
    deflection per distance driven, so that gravity drags a driving robot and leaves a standing one.

    Attributes:
        wheels: front left, front right, rear left, rear right.
        encoder_angles: true angles of the encoder wheels v and u since the start, rad.
        encoder_speeds: their speeds, rad/s.
        twist: mean depth of front left and rear right wheels less that of the others, halved, metres; the frame gives
            way by it, so that all four wheels carry on ground that isn't flat under them.
    """

    def __init__(self, surface: Surface, parameters: WorldParameters, flaws: Imperfections, client: int) -> None:
        self.parameters = parameters
        self._surface = surface
        # Read at C speed where there is one.
        self._paraboloid: Paraboloid | None = getattr(surface, "paraboloid", None)
        self._client = client
        self._dt = 1.0 / parameters.physics_hz
        self._mass_offset = (flaws.mass_x_m, flaws.mass_y_m, parameters.chassis.mass_height_m)
        self._weight = parameters.chassis.mass_kg * parameters.gravity_m_s2
        traction = parameters.traction
        self._law = TractionLaw(
            stiffness_n_m=traction.normal_stiffness_n_m,
            damping_n_s_m=traction.normal_damping_n_s_m,
            friction=traction.friction,
            roller_drag=traction.roller_drag,
            bristle_stiffness_n_m=traction.bristle_stiffness_n_m,
            bristle_damping_n_s_m=traction.bristle_damping_n_s_m,
            relaxation_m=traction.relaxation_m,
            contact_radius_m=parameters.wheels.radius_m,
            twist_softness_n_m=max(0.0, traction.normal_stiffness_n_m - parameters.chassis.twist_stiffness_n_m),
            twist_travel_m=parameters.chassis.twist_travel_m,
        )
        self.twist = 0.0
        self.wheels = self._make_wheels(flaws.rolling_radius_scale, flaws.motor_gain)
        encoder = parameters.encoder_wheels
        v_radius, u_radius = (0.5 * encoder.diameter_m * scale for scale in flaws.encoder_radius_scale)
        cx, cy, cz = self._mass_offset
        self._v_wheel = (encoder.v_wheel_x_m - cx, encoder.v_wheel_y_m - cy, -cz, 1.0 / v_radius)
        self._u_wheel = (encoder.u_wheel_x_m - cx, encoder.u_wheel_y_m - cy, -cz, 1.0 / u_radius)
        self.encoder_angles = [0.0, 0.0]
        self.encoder_speeds = [0.0, 0.0]
        self.index = self._make_body()
        self._pose: Pose | None = None  # as long as it is known

    def _make_wheels(self, radius_scales: Sequence[float], gains: Sequence[float]) -> tuple[Wheel, ...]:
        p = self.parameters
        # Under its own weight the robot sinks in by this much; base_link's origin then touches level ground.
        sag = self._weight / (4.0 * p.traction.normal_stiffness_n_m)
        height = p.wheels.radius_m - sag
        cx, cy, cz = self._mass_offset
        half_base, half_track = 0.5 * p.wheels.wheelbase_m, 0.5 * p.wheels.track_m
        places = ((1, 1, -1.0), (1, -1, 1.0), (-1, 1, 1.0), (-1, -1, -1.0))
        return tuple(
            Wheel(
                p.motor,
                (i * half_base - cx, j * half_track - cy, height - cz),
                side,
                p.wheels.radius_m * scale,
                gain,
                self._dt,
            )
            for (i, j, side), scale, gain in zip(places, radius_scales, gains, strict=True)
        )

    def _make_body(self) -> int:
        chassis = self.parameters.chassis
        half = (0.5 * chassis.length_m, 0.5 * chassis.width_m, 0.5 * (chassis.body_top_m - chassis.body_bottom_m))
        cx, cy, cz = self._mass_offset
        client = self._client
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX,
            halfExtents=half,
            collisionFramePosition=(-cx, -cy, chassis.body_bottom_m + half[2] - cz),
            physicsClientId=client,
        )
        body: int = pybullet.createMultiBody(
            baseMass=chassis.mass_kg, baseCollisionShapeIndex=shape, physicsClientId=client
        )
        third = chassis.mass_kg / 3.0
        xx, yy, zz = (half[i] * half[i] for i in range(3))
        pybullet.changeDynamics(
            body,
            -1,
            localInertiaDiagonal=(third * (yy + zz), third * (xx + zz), third * (xx + yy)),
            linearDamping=0.0,
            angularDamping=0.0,
            lateralFriction=0.3,
            physicsClientId=client,
        )
        return body

    def place(self, pose: Pose) -> None:
        """Put base_link at a pose, at rest; the wheels keep their state."""
        x, y, z = pose.position
        ox, oy, oz = rotate(pose.orientation, self._mass_offset)
        pybullet.resetBasePositionAndOrientation(
            self.index, (x + ox, y + oy, z + oz), pose.orientation, physicsClientId=self._client
        )
        self.freeze()

    def shift(self, pose: Pose) -> None:
        """Put base_link at a pose with the velocities that it has; wheels and encoders keep their state."""
        velocities, speeds = _read_velocity(self.index, self._client), self.encoder_speeds
        self.place(pose)
        pybullet.resetBaseVelocity(self.index, *velocities, physicsClientId=self._client)
        self.encoder_speeds = speeds

    def freeze(self) -> None:
        """Set all velocities to zero, and keep the pose.

        Bullet changes the last digit of a standing body's orientation now and then: all who ask later are told
        this one.
        """
        pybullet.resetBaseVelocity(self.index, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), physicsClientId=self._client)
        self.encoder_speeds = [0.0, 0.0]
        self.read_pose()

    def speed_squares(self) -> tuple[float, float]:
        """Squares of the centre of mass's speed (m/s) and of the turning rate (rad/s)."""
        (vx, vy, vz), (wx, wy, wz) = _read_velocity(self.index, self._client)
        return vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz

    def pose(self) -> Pose:
        """Pose of base_link: the same object as long as the body stands."""
        return self.read_pose() if self._pose is None else self._pose

    def read_pose(self) -> Pose:
        """Ask the physics for the pose of base_link, and keep it."""
        (x, y, z), orientation = _read_pose(self.index, self._client)
        ox, oy, oz = rotate(orientation, self._mass_offset)
        self._pose = Pose((x - ox, y - oy, z - oz), orientation)
        return self._pose

    def state(self) -> BodyState:
        """Pose of base_link and its velocity."""
        pose = self.pose()
        (vx, vy, vz), (wx, wy, wz) = pybullet.getBaseVelocity(self.index, physicsClientId=self._client)
        ox, oy, oz = rotate(pose.orientation, self._mass_offset)
        linear: Vector = (vx - (wy * oz - wz * oy), vy - (wz * ox - wx * oz), vz - (wx * oy - wy * ox))
        return BodyState(pose, linear, (wx, wy, wz))

    def apply_ground_forces(self) -> None:
        """Apply gravity and the ground's forces for the coming physics step, and turn the wheels.

        One long function on purpose: it is the simulation's hot loop, in plain scalars and local names.
        """
        client, body, dt = self._client, self.index, self._dt
        self._pose = None
        # All fields of the law in their order: ten reads by name would take twice as long.
        stiffness, damping, grip, drag, sigma0, sigma1, relaxation, contact_radius, soft, travel = self._law
        # The last step's twist: it changes with the distance driven only.
        yielding, twist = soft * max(-travel, min(travel, self.twist)), 0.0
        (px, py, pz), (qx, qy, qz, qw) = _read_pose(body, client)
        (vx, vy, vz), (wx, wy, wz) = _read_velocity(body, client)
        # Columns of the rotation matrix: forward (f), left (l), up (u).
        f_x, f_y, f_z = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy + qw * qz), 2 * (qx * qz - qw * qy)
        l_x, l_y, l_z = 2 * (qx * qy - qw * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz + qw * qx)
        u_x, u_y, u_z = 2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx), 1 - 2 * (qx * qx + qy * qy)
        force_x = force_y = torque_x = torque_y = torque_z = 0.0
        force_z = -self._weight
        for wheel in self.wheels:
            wheel_x, wheel_y, wheel_z = wheel.x, wheel.y, wheel.z
            centre_x = px + f_x * wheel_x + l_x * wheel_y + u_x * wheel_z
            centre_y = py + f_y * wheel_x + l_y * wheel_y + u_y * wheel_z
            centre_z = pz + f_z * wheel_x + l_z * wheel_y + u_z * wheel_z
            # Contact point: the centre moved by the radius against the normal found there (two iterations).
            slope_x, slope_y = self._slopes(centre_x, centre_y)
            n_z = contact_radius / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
            slope_x, slope_y = self._slopes(centre_x + slope_x * n_z, centre_y + slope_y * n_z)
            n_z = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
            n_x, n_y = -slope_x * n_z, -slope_y * n_z
            at_x, at_y = centre_x - contact_radius * n_x, centre_y - contact_radius * n_y
            at_z = centre_z - contact_radius * n_z
            arm_x, arm_y, arm_z = at_x - px, at_y - py, at_z - pz
            s_x = vx + wy * arm_z - wz * arm_y
            s_y = vy + wz * arm_x - wx * arm_z
            s_z = vz + wx * arm_y - wy * arm_x
            depth, side = (self._height(at_x, at_y) - at_z) * n_z, wheel.side
            twist -= side * depth
            load = stiffness * depth + side * yielding - damping * (s_x * n_x + s_y * n_y + s_z * n_z)
            if load <= 1e-9:
                wheel.bristle = 0.0
                if wheel.state == DRIVING:
                    wheel.control(dt)
                wheel.turn(0.0, dt)
                continue
            # Forward and left in the tangent plane, and the contact's velocity along them.
            off = f_x * n_x + f_y * n_y + f_z * n_z
            scale = 1.0 / math.sqrt(1.0 - off * off)
            a_x, a_y, a_z = (
                (f_x - off * n_x) * scale,
                (f_y - off * n_y) * scale,
                (f_z - off * n_z) * scale,
            )
            b_x, b_y, b_z = n_y * a_z - n_z * a_y, n_z * a_x - n_x * a_z, n_x * a_y - n_y * a_x
            ahead = s_x * a_x + s_y * a_y + s_z * a_z
            aside = (s_x * b_x + s_y * b_y + s_z * b_z) * side
            # Sliding of the ground past the rim: held along the roller's axis, rolling off across it.
            past = ahead - wheel.rolling_radius * wheel.speed
            slip = (past + aside) * HALF_ROOT
            free = (past - aside) * HALF_ROOT
            limit = grip * load + 1e-12
            bristle = (wheel.bristle + dt * slip) / (
                1.0 + dt * (abs(slip) * sigma0 / limit + math.sqrt(ahead * ahead + aside * aside) / relaxation)
            )
            wheel.bristle = bristle
            hold = -(sigma0 * bristle + sigma1 * slip)
            if hold > limit:
                hold = limit
            elif hold < -limit:
                hold = -limit
            roll = -drag * load * free / (abs(free) + ROLLER_DRAG_SPEED)
            push_a = (hold + roll) * HALF_ROOT
            push_b = (hold - roll) * HALF_ROOT * side
            g_x = load * n_x + push_a * a_x + push_b * b_x
            g_y = load * n_y + push_a * a_y + push_b * b_y
            g_z = load * n_z + push_a * a_z + push_b * b_z
            force_x += g_x
            force_y += g_y
            force_z += g_z
            torque_x += arm_y * g_z - arm_z * g_y
            torque_y += arm_z * g_x - arm_x * g_z
            torque_z += arm_x * g_y - arm_y * g_x
            state = wheel.state
            if state != HELD:
                if state == DRIVING:
                    wheel.control(dt)
                wheel.turn(-push_a * wheel.rolling_radius, dt)
        self.twist = 0.25 * twist
        _apply_force(body, -1, (force_x, force_y, force_z), (px, py, pz), _WORLD_FRAME, client)
        _apply_torque(body, -1, (torque_x, torque_y, torque_z), _WORLD_FRAME, client)
        # Encoder wheels: velocity of their ground point along +x and +y of the body.
        spin_f = wx * f_x + wy * f_y + wz * f_z
        spin_l = wx * l_x + wy * l_y + wz * l_z
        spin_u = wx * u_x + wy * u_y + wz * u_z
        _, e_y, e_z, per_radius = self._v_wheel
        v_rate = (vx * f_x + vy * f_y + vz * f_z + spin_l * e_z - spin_u * e_y) * per_radius
        e_x, _, e_z, per_radius = self._u_wheel
        u_rate = (vx * l_x + vy * l_y + vz * l_z + spin_u * e_x - spin_f * e_z) * per_radius
        angles = self.encoder_angles
        angles[0] += dt * v_rate
        angles[1] += dt * u_rate
        self.encoder_speeds = [v_rate, u_rate]

    def _slopes(self, x: float, y: float) -> tuple[float, float]:
        """The ground's slopes along the world's x and y."""
        if self._paraboloid is None:
            return self._surface.gradient(x, y)
        return self._paraboloid.slope_x(x), self._paraboloid.slope_y(y)

    def _height(self, x: float, y: float) -> float:
        """The ground's height, metres."""
        if self._paraboloid is None:
            return self._surface.height(x, y)
        return self._paraboloid.height(x, y)
