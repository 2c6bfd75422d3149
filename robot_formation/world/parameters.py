"""Every number of the simulated world: robots, motors, traction, sensors, cameras, time."""

from __future__ import annotations

from dataclasses import dataclass, fields

from robot_formation.parameters import Choice, ParameterError, parameter
from robot_formation.vision.marker import MarkerKind
from robot_formation.vision.overhead.lens import OverheadLens


class DriveMode(Choice):
    """How a robot's firmware ends a motion."""

    PWM_STOP = "pwm_stop"
    PID = "pid"


class CameraMode(Choice):
    """When a robot's camera takes frames: at every tick while time advances, or as requested."""

    STREAM = "stream"
    ON_DEMAND = "on_demand"


@dataclass(frozen=True)
class ChassisParameters:
    """Body of a robot (paper: 365 x 238 x 216 mm, 1.700 kg)."""

    length_m: float = parameter(0.365, "length along x", unit="m", low=0.05, high=2.0)
    width_m: float = parameter(0.238, "width along y", unit="m", low=0.05, high=2.0)
    body_bottom_m: float = parameter(0.012, "ground clearance of the body", unit="m", low=0.0, high=0.5)
    body_top_m: float = parameter(
        0.140, "top of the body; low enough that its edge doesn't hide the marker's foot", unit="m", low=0.02, high=2.0
    )
    mass_kg: float = parameter(1.7, "mass of the robot", unit="kg", low=0.1, high=50.0)
    mass_height_m: float = parameter(0.05, "height of the centre of mass", unit="m", low=0.0, high=0.5)
    twist_stiffness_n_m: float = parameter(
        300.0,
        "stiffness of the frame against twist, per wheel: what one diagonal pair of wheels gains on twisted ground; "
        "traction.normal_stiffness_n_m or more is a rigid frame",
        unit="N/m",
        low=0.0,
        high=1e6,
    )
    twist_travel_m: float = parameter(
        0.012, "how far each wheel may give way by the frame's twist", unit="m", low=0.0, high=0.5
    )


@dataclass(frozen=True)
class WheelParameters:
    """Four mecanum wheels with rollers at 45 degrees."""

    radius_m: float = parameter(0.030, "wheel radius", unit="m", low=0.005, high=0.2)
    wheelbase_m: float = parameter(0.220, "distance of front and rear axles", unit="m", low=0.02, high=1.0)
    track_m: float = parameter(0.190, "distance of left and right wheel middles", unit="m", low=0.02, high=1.0)


@dataclass(frozen=True)
class MotorParameters:
    """Geared DC motors, their encoders and the firmware that stops them."""

    drive_mode: DriveMode = parameter(
        DriveMode.PWM_STOP,
        "pwm_stop: constant PWM until the encoder count is reached, then short brake; pid: trapezoid and PID",
    )
    max_speed_rad_s: float = parameter(12.0, "no-load speed at full PWM", unit="rad/s", low=0.5, high=100.0)
    max_angle_rad: float = parameter(200.0, "largest wheel angle of one command", unit="rad", low=1.0, high=1e5)
    inertia_kg_m2: float = parameter(6e-4, "rotor and wheel, at the wheel", unit="kg m^2", low=1e-5, high=0.1)
    back_emf_n_m_s: float = parameter(0.03, "torque lost per wheel speed", unit="N m s", low=1e-4, high=1.0)
    friction_n_m: float = parameter(0.03, "gear friction", unit="N m", low=0.0, high=1.0)
    counts_per_turn: int = parameter(1496, "motor encoder counts per wheel turn", low=4, high=1000000)
    acceleration_rad_s2: float = parameter(20.0, "pid: slope of the trapezoid", unit="rad/s^2", low=0.1, high=1e3)
    pid_p: float = parameter(0.9, "pid: proportional gain", unit="N m/rad", low=0.0, high=100.0)
    pid_i: float = parameter(3.0, "pid: integral gain", unit="N m/(rad s)", low=0.0, high=1000.0)
    pid_d: float = parameter(0.02, "pid: derivative gain", unit="N m s/rad", low=0.0, high=10.0)
    pid_settle_s: float = parameter(0.5, "pid: longest time allowed to settle", unit="s", low=0.0, high=10.0)


@dataclass(frozen=True)
class TractionParameters:
    """Contact of the wheels with the ground."""

    friction: float = parameter(0.45, "friction coefficient of the rollers", low=0.0, high=3.0)
    relaxation_m: float = parameter(
        0.015, "distance over which a driving wheel forgets its grip: smaller slips more", unit="m", low=1e-4, high=1e3
    )
    bristle_stiffness_n_m: float = parameter(2000.0, "tangential stiffness", unit="N/m", low=1.0, high=1e5)
    bristle_damping_n_s_m: float = parameter(15.0, "tangential damping", unit="N s/m", low=0.0, high=1e3)
    normal_stiffness_n_m: float = parameter(4000.0, "stiffness across the ground", unit="N/m", low=100.0, high=1e6)
    normal_damping_n_s_m: float = parameter(58.0, "damping across the ground", unit="N s/m", low=0.0, high=1e4)
    roller_drag: float = parameter(0.02, "rolling resistance of the rollers per wheel load", low=0.0, high=1.0)


@dataclass(frozen=True)
class EncoderWheelParameters:
    """Two unpowered omni wheels that measure the body's motion (paper: 38 mm, 512 pulses per turn).

    `encoder_wheel_v` counts up for motion along +x (forward), `encoder_wheel_u` along +y (left, REP-103: the
    opposite sense of the paper's u).
    """

    diameter_m: float = parameter(0.038, "wheel diameter", unit="m", low=0.005, high=0.2)
    pulses_per_turn: int = parameter(512, "pulses per turn", low=4, high=100000)
    v_wheel_x_m: float = parameter(0.0, "x of the v wheel in base_link", unit="m", low=-1.0, high=1.0)
    v_wheel_y_m: float = parameter(-0.03, "y of the v wheel in base_link", unit="m", low=-1.0, high=1.0)
    u_wheel_x_m: float = parameter(-0.05, "x of the u wheel in base_link", unit="m", low=-1.0, high=1.0)
    u_wheel_y_m: float = parameter(0.0, "y of the u wheel in base_link", unit="m", low=-1.0, high=1.0)


@dataclass(frozen=True)
class ImperfectionParameters:
    """Standard deviations of what differs between robots, wheels and moves; all zero for ideal robots."""

    rolling_radius: float = parameter(0.005, "rolling radius of each wheel, relative", low=0.0, high=0.2)
    motor_gain: float = parameter(0.03, "torque of each motor, relative", low=0.0, high=0.5)
    mass_offset_m: float = parameter(0.002, "centre of mass in x and in y", unit="m", low=0.0, high=0.05)
    encoder_wheel_radius: float = parameter(0.003, "radius of each encoder wheel, relative", low=0.0, high=0.2)
    stop_common_m: float = parameter(
        0.0015,
        "pwm_stop: late or early stop of a whole move, in travel of the fastest wheel",
        unit="m",
        low=0.0,
        high=0.1,
    )
    stop_wheel_m: float = parameter(
        0.0003, "pwm_stop: late or early stop of each wheel, in its travel", unit="m", low=0.0, high=0.1
    )


@dataclass(frozen=True)
class CameraParameters:
    """Sideways camera (Pixy2: 60 degrees over 316 pixels), its sensor, and the room's light.

    Descriptions of what a user tunes on the camera begin with the parameter's name in PixyMon.
    """

    mode: CameraMode = parameter(
        CameraMode.STREAM, "stream: a frame at every tick while time advances; on_demand: requested frames"
    )
    camera_brightness: int = parameter(
        100,
        "Camera brightness: mean level of the picture that auto exposure aims at (camera's default: 50)",
        low=0,
        high=255,
    )
    auto_exposure_correction: bool = parameter(
        True,
        "Auto Exposure Correction: choose exposure time and gain for each picture; false: keep the first picture's",
    )
    auto_white_balance: bool = parameter(
        True, "Auto White Balance: make grey grey in each picture; false: keep what power-up gave (camera's default)"
    )
    auto_white_balance_on_power_up: bool = parameter(
        True, "Auto White Balance on power-up: balance the first picture; false: the camera's own colours"
    )
    flicker_avoidance: bool = parameter(
        True, "Flicker avoidance: expose for whole periods of the light's flicker (camera's default: false)"
    )
    min_frames_per_second: int = parameter(
        30,
        "Min frames per second: the frame rate, and with it the longest exposure (camera's default: 61)",
        unit="Hz",
        low=2,
        high=61,
    )
    width_px: int = parameter(316, "columns", unit="px", low=16, high=4096)
    height_px: int = parameter(208, "rows", unit="px", low=16, high=4096)
    focal_length_px: float = parameter(273.7, "focal length in x and y", unit="px", low=10.0, high=1e4)
    centre_x_px: float = parameter(157.5, "column of the optical axis", unit="px")
    centre_y_px: float = parameter(103.5, "row of the optical axis", unit="px")
    x_m: float = parameter(0.0, "lens in base_link", unit="m", low=-1.0, high=1.0)
    y_m: float = parameter(-0.038, "lens in base_link", unit="m", low=-1.0, high=1.0)
    z_m: float = parameter(0.126, "lens in base_link", unit="m", low=0.0, high=2.0)
    pan_deg: float = parameter(
        90.0, "direction of view about z, 0 forward, 90 left", unit="deg", low=-360.0, high=360.0
    )
    tilt_deg: float = parameter(0.0, "direction of view above the horizontal", unit="deg", low=-89.0, high=89.0)
    near_m: float = parameter(0.02, "nearest distance drawn", unit="m", low=1e-3, high=1.0)
    gamma: float = parameter(1.5, "8-bit level = 255 light^(1/gamma)", low=1.0, high=3.0)
    blur_px: float = parameter(0.5, "standard deviation of the lens blur, 0 for none", unit="px", low=0.0, high=10.0)
    shot_noise: float = parameter(2.0e-4, "variance per linear light at gain 1, full scale 1", low=0.0, high=1.0)
    read_noise: float = parameter(
        2.9e-4, "standard deviation in the dark at gain 1, linear, full scale 1", low=0.0, high=1.0
    )
    illuminance_lux: float = parameter(500.0, "light in the room", unit="lx", low=0.0, high=2e5)
    light_colour_rgb: tuple[int, ...] = parameter((255, 255, 255), "colour of the light, linear", low=1, high=255)
    mains_hz: int = parameter(50, "mains frequency; lamps flicker at twice of it", unit="Hz", choices=(50, 60))
    mains_flicker: float = parameter(
        0.2, "depth of the flicker: light is 1 + depth cos(4 pi mains_hz t)", low=0.0, high=1.0
    )
    wall_albedo: int = parameter(150, "grey of the wall behind the plate, linear", low=1, high=255)
    plate_albedo: int = parameter(66, "grey of the plate, linear", low=1, high=255)
    plate_patches: int = parameter(12, "shaded patches per edge of the plate", low=1, high=200)
    ambient: float = parameter(0.6, "share of light that comes from everywhere", low=0.0, high=1.0)
    light_x: float = parameter(-0.25, "direction to the lamp, world frame", low=-1.0, high=1.0)
    light_y: float = parameter(-0.35, "direction to the lamp, world frame", low=-1.0, high=1.0)
    light_z: float = parameter(0.90, "direction to the lamp, world frame", low=0.01, high=1.0)

    def __post_init__(self) -> None:
        """Check that the light's colour has three components."""
        if len(self.light_colour_rgb) != 3:
            raise ParameterError("world: 'camera.light_colour_rgb' needs three numbers (red, green, blue)")


@dataclass(frozen=True)
class OverheadParameters(OverheadLens):
    """Grey camera above the plate that looks straight down; its picture's top is the plate's far edge (+y)."""

    enabled: bool = parameter(False, "take a picture at the start and whenever all robots have come to rest")
    width_px: int = parameter(512, "columns", unit="px", low=16, high=4096)
    height_px: int = parameter(512, "rows", unit="px", low=16, high=4096)
    blur_px: float = parameter(0.6, "standard deviation of the lens blur, 0 for none", unit="px", low=0.0, high=10.0)
    noise: float = parameter(1.5, "standard deviation of the sensor's noise, in 8-bit levels", low=0.0, high=50.0)
    floor_albedo: int = parameter(30, "grey of the floor around the plate, linear", low=0, high=255)


@dataclass(frozen=True)
class MarkerParameters:
    """Cube over base_link's origin: its Target face looks right (-y), Front +x, Rear -x, a white dot on top.

    The three faces have a colour each, or carry a tag each. Colours are red, green, blue from 0 to 255 in linear light.
    """

    kind: MarkerKind = parameter(
        MarkerKind.COLOURS,
        "what tells the faces apart; colours: one each; tags: an ArUco tag each, for block_detector's sensor 'tags'",
    )
    edge_m: float = parameter(0.06, "edge of the cube", unit="m", low=0.005, high=0.5)
    top_m: float = parameter(0.216, "height of its top, the robot's height", unit="m", low=0.02, high=2.0)
    target_rgb: tuple[int, ...] = parameter((205, 14, 16), "Target face", low=0, high=255)
    front_rgb: tuple[int, ...] = parameter((16, 150, 22), "Front face", low=0, high=255)
    rear_rgb: tuple[int, ...] = parameter((14, 34, 200), "Rear face", low=0, high=255)
    tag_light_rgb: tuple[int, ...] = parameter((200, 200, 200), "tags: light modules and margin", low=0, high=255)
    tag_dark_rgb: tuple[int, ...] = parameter((12, 12, 13), "tags: dark modules", low=0, high=255)
    backdrop_m: float = parameter(
        0.0,
        "width of a board at the cube's left face, which hides the markers of robots farther left; 0: none. "
        "A scenario with two followers and more sets 0.16",
        unit="m",
        low=0.0,
        high=0.5,
    )
    # In the room's light about as light as the wall: a face's edges are seen elsewhere before a dark ground.
    backdrop_rgb: tuple[int, ...] = parameter((220, 220, 220), "that board", low=0, high=255)
    body_rgb: tuple[int, ...] = parameter((12, 12, 13), "robot body and the cube's other faces", low=0, high=255)
    dot_rgb: tuple[int, ...] = parameter((230, 230, 230), "reference dot", low=0, high=255)
    dot_radius_m: float = parameter(0.015, "radius of the reference dot", unit="m", low=0.001, high=0.2)

    def __post_init__(self) -> None:
        """Check that every colour has three components."""
        for field in fields(self):
            if field.name.endswith("_rgb") and len(getattr(self, field.name)) != 3:
                raise ParameterError(f"world: 'marker.{field.name}' needs three numbers (red, green, blue)")

    @property
    def face_colours(self) -> tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]:
        """Ground colours of Target, Front and Rear."""
        if self.kind is MarkerKind.TAGS:
            return (self.tag_light_rgb,) * 3
        return self.target_rgb, self.front_rgb, self.rear_rgb


@dataclass(frozen=True)
class WorldParameters:
    """Parameters of the simulated world."""

    physics_hz: int = parameter(240, "physics steps per simulated second", unit="Hz", low=200, high=10000)
    state_rate_hz: int = parameter(
        20, "joint states and poses per simulated second of motion", unit="Hz", low=1, high=1000
    )
    gravity_m_s2: float = parameter(9.81, "gravity", unit="m/s^2", low=0.0, high=100.0)
    motion_timeout_s: float = parameter(30.0, "a motion that takes longer is braked", unit="s", low=0.05, high=3600.0)
    sleep: bool = parameter(True, "freeze robots at rest until their next command or until touched")
    rest_speed_m_s: float = parameter(1e-3, "a body slower than this rests", unit="m/s", low=1e-7, high=0.1)
    rest_rate_rad_s: float = parameter(
        1e-2, "a body that turns slower than this rests", unit="rad/s", low=1e-6, high=1.0
    )
    rest_time_s: float = parameter(0.05, "how long it must hold to count as rest", unit="s", low=0.0, high=10.0)
    lockstep: tuple[str, ...] = parameter((), "robots whose motions start together, once each has a command")
    chassis: ChassisParameters = ChassisParameters()
    wheels: WheelParameters = WheelParameters()
    motor: MotorParameters = MotorParameters()
    traction: TractionParameters = TractionParameters()
    encoder_wheels: EncoderWheelParameters = EncoderWheelParameters()
    imperfections: ImperfectionParameters = ImperfectionParameters()
    camera: CameraParameters = CameraParameters()
    marker: MarkerParameters = MarkerParameters()
    overhead: OverheadParameters = OverheadParameters()

    def __post_init__(self) -> None:
        """Check what involves more than one parameter."""
        for name, rate in (
            ("camera.min_frames_per_second", self.camera.min_frames_per_second),
            ("state_rate_hz", self.state_rate_hz),
        ):
            if self.physics_hz % rate:
                raise ParameterError(
                    f"world: '{name}' is {rate} Hz, which is no whole number of physics steps; "
                    f"it must divide physics_hz = {self.physics_hz}"
                )
        if self.chassis.body_top_m <= self.chassis.body_bottom_m:
            raise ParameterError("world: 'chassis.body_top_m' must lie above 'chassis.body_bottom_m'")
        if self.marker.top_m - self.marker.edge_m < self.chassis.body_top_m:
            raise ParameterError("world: the marker must stand on the body: raise 'marker.top_m'")
