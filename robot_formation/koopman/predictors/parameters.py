"""Parameters of every predictor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from robot_formation import plugins
from robot_formation.parameters import ParameterError, parameter

CLOSABLE = ("previous", "ewma", "kalman_trend", "measured", "edmd")
"""Models that may run with residual closing and bias learning, as NAME+close."""
CLOSE = "+close"
TREND_CLOSE = "trend+close"
NAMES = (*CLOSABLE, "literal", "formation", *(f"{name}{CLOSE}" for name in CLOSABLE), TREND_CLOSE)


def is_outside_predictor(name: str) -> bool:
    """Whether a name may be that of a predictor from outside the package; its class is not imported for it."""
    return plugins.may_be(name.removesuffix(CLOSE), "predictor")


def check_predictor_name(name: str, also: Iterable[str] = ()) -> None:
    """Check a predictor's name; a class from outside is not imported for it.

    Args:
        name: to be checked.
        also: further names that may be used.

    Raises:
        PluginError: with the nearest known name.
    """
    known = (*NAMES, *also)
    if name not in known and not is_outside_predictor(name):
        raise plugins.unknown("predictor", name, known)


@dataclass(frozen=True)
class EwmaParameters:
    """Exponentially weighted moving average."""

    gain: float = parameter(0.4, "Weight of the newest displacement", low=0.0, high=1.0)


@dataclass(frozen=True)
class TrendParameters:
    """Kalman filter of a level with a damped trend, each axis by itself."""

    noise_m: float = parameter(
        0.002, "Standard deviation of a displacement about its level", unit="m", low=1e-6, high=1.0
    )
    level_m: float = parameter(
        0.0004, "Standard deviation of the level's own change in a timestep", unit="m", low=0.0, high=1.0
    )
    trend_m: float = parameter(
        0.0003, "Standard deviation of the trend's change in a timestep", unit="m", low=0.0, high=1.0
    )
    start_trend_m: float = parameter(
        0.001, "Standard deviation of the trend before the first displacement", unit="m", low=0.0, high=1.0
    )
    damping: float = parameter(0.9, "Share of the trend that is left after a timestep", low=0.0, high=1.0)


@dataclass(frozen=True)
class EdmdParameters:
    """Online EDMD with a dictionary of the user's and a prior: persistence."""

    dictionary: str = parameter(
        "constant identity",
        "Observables, separated by spaces: constant, identity, monomials:DEGREE, rbf:COUNT, delay:COUNT",
    )
    prior: float = parameter(
        0.01,
        "Weight of the prior (K = I), as the squared length of an observable that counts as much",
        low=1e-12,
        high=1e6,
    )
    scale_m: float = parameter(
        0.05,
        "Displacements are divided by this length before the observables are computed",
        unit="m",
        low=1e-4,
        high=10.0,
    )
    window: int = parameter(0, "Newest pairs that count; 0 for all", low=0, high=100000)
    forgetting: float = parameter(1.0, "Weight of a pair relative to the next newer one", low=0.01, high=1.0)


@dataclass(frozen=True)
class ClosingParameters:
    """Closing of the camera's residual and learning of the actuation bias ('formation' and NAME+close).

    Three lists, of equal length, describe a bank of filters from one that trusts in steadiness to one that follows
    every change.
    """

    residual_u_m: float = parameter(
        0.006, "Standard deviation of the camera's residual along u (side length)", unit="m", low=1e-6, high=1.0
    )
    residual_v_m: float = parameter(
        0.001, "Standard deviation of the camera's residual along v (column)", unit="m", low=1e-6, high=1.0
    )
    start_u_m: float = parameter(
        0.007, "Standard deviation of the residual along u before timestep 1", unit="m", low=1e-6, high=1.0
    )
    start_v_m: float = parameter(
        0.002, "Standard deviation of the residual along v before timestep 1", unit="m", low=1e-6, high=1.0
    )
    step_u_m: float = parameter(
        0.0, "Leader-induced displacement along u known beforehand", unit="m", low=-1.0, high=1.0
    )
    step_v_m: float = parameter(
        0.05, "Leader-induced displacement along v known beforehand", unit="m", low=-1.0, high=1.0
    )
    step_sigma_u_m: float = parameter(0.003, "Standard deviation of it along u", unit="m", low=1e-6, high=1.0)
    step_sigma_v_m: float = parameter(0.0025, "Standard deviation of it along v", unit="m", low=1e-6, high=1.0)
    residual_turn_rad: float = parameter(
        0.012, "Standard deviation of the camera's residual turn", unit="rad", low=1e-6, high=3.2
    )
    start_turn_rad: float = parameter(
        0.02, "Standard deviation of the residual turn before timestep 1", unit="rad", low=1e-6, high=3.2
    )
    step_turn_rad: float = parameter(0.0, "Leader-induced turn known beforehand", unit="rad", low=-3.2, high=3.2)
    step_sigma_turn_rad: float = parameter(0.006, "Standard deviation of it", unit="rad", low=1e-6, high=3.2)
    rad_per_m: float = parameter(
        3.0, "Turns are filtered with the lengths below times this", unit="rad/m", low=1e-6, high=1000.0
    )
    noise_m: tuple[float, ...] = parameter(
        (0.0016, 0.0025, 0.005),
        "Filters: standard deviation of the leader-induced displacement about its level",
        unit="m",
        low=1e-6,
        high=1.0,
    )
    level_m: tuple[float, ...] = parameter(
        (0.0003, 0.001, 0.012),
        "Filters: standard deviation of the level's own change in a timestep",
        unit="m",
        low=0.0,
        high=1.0,
    )
    trend_m: tuple[float, ...] = parameter(
        (0.0, 0.0005, 0.0),
        "Filters: standard deviation of the trend's change in a timestep",
        unit="m",
        low=0.0,
        high=1.0,
    )
    trend_start_m: float = parameter(
        0.0003, "Standard deviation of the level's trend at first", unit="m", low=0.0, high=1.0
    )
    discount: float = parameter(0.9, "Weight of a past innovation relative to the next newer one", low=0.01, high=1.0)
    trend_damping: float = parameter(0.8, "Share of the trend that is left after a timestep", low=0.0, high=1.0)
    bias_m: float = parameter(
        0.008, "Standard deviation of the actuation bias before anything is known", unit="m", low=0.0, high=1.0
    )
    bias: TrendParameters = TrendParameters(
        noise_m=0.003, level_m=0.001, trend_m=0.0002, start_trend_m=0.0005, damping=0.9
    )

    def __post_init__(self) -> None:
        """Check that every filter has its three numbers."""
        lengths = {len(self.noise_m), len(self.level_m), len(self.trend_m)}
        if len(lengths) != 1 or not self.noise_m:
            raise ParameterError(
                "predictor: 'closing.noise_m', 'level_m' and 'trend_m' need one number for each filter"
            )


@dataclass(frozen=True)
class OscillatorParameters:
    """Bank of Koopman oscillators: periods in timesteps, evenly spaced in the root of frequency."""

    shortest: float = parameter(5.0, "Shortest period", unit="timesteps", low=2.1, high=1000.0)
    longest: float = parameter(80.0, "Longest period", unit="timesteps", low=2.1, high=10000.0)
    count: int = parameter(72, "How many periods", low=2, high=1000)
    level_start_m: float = parameter(0.02, "Standard deviation of the level at first", unit="m", low=1e-6, high=1.0)
    amplitude_m: float = parameter(0.03, "Standard deviation of amplitudes at first", unit="m", low=1e-6, high=1.0)
    noise_m: float = parameter(
        0.0016, "Standard deviation of the leader-induced displacement about the model", unit="m", low=1e-6, high=1.0
    )
    level_m: float = parameter(0.0002, "Standard deviation of the level's change", unit="m", low=0.0, high=1.0)
    change_m: float = parameter(0.0004, "Standard deviation of the amplitudes' change", unit="m", low=0.0, high=1.0)
    discount: float = parameter(0.95, "Weight of a past innovation relative to the next newer one", low=0.01, high=1.0)


@dataclass(frozen=True)
class FormationParameters:
    """The project's own predictor: experts combined per axis by how well each has forecast lately."""

    aggregation: str = parameter(
        "exponential",
        "How experts are combined: discounted exponential weights, or ML-Poly, which has no learning rate",
        choices=("exponential", "ml_poly"),
    )
    discount: float = parameter(0.9, "Weight of a past error relative to the next newer one", low=0.01, high=1.0)
    initial_loss: float = parameter(
        2.0,
        "How much other experts are behind persistence at first (logarithm of the weights' ratio)",
        low=0.0,
        high=100.0,
    )
    coupling: float = parameter(
        0.3, "Share of the error along u that counts along v, and the other way round", low=0.0, high=1.0
    )
    scale_u_m: float = parameter(0.006, "Error along u that makes an expert unlikely", unit="m", low=1e-6, high=1.0)
    scale_v_m: float = parameter(0.003, "Error along v that makes an expert unlikely", unit="m", low=1e-6, high=1.0)
    trend_m: tuple[float, ...] = parameter(
        (0.002, 0.004),
        "Trend filters beside those of the closing: standard deviation of the trend's change in a timestep",
        unit="m",
        low=0.0,
        high=1.0,
    )
    trend_damping: tuple[float, ...] = parameter(
        (1.0, 0.95), "Trend filters: share of the trend that is left after a timestep", low=0.0, high=1.0
    )
    trend_start_m: float = parameter(
        0.002, "Trend filters: standard deviation of the trend at first", unit="m", low=0.0, high=1.0
    )
    edmd: EdmdParameters = EdmdParameters(dictionary="constant delay:3", prior=0.05)
    oscillators: OscillatorParameters = OscillatorParameters()

    def __post_init__(self) -> None:
        """Check that every trend filter has its two numbers."""
        if len(self.trend_m) != len(self.trend_damping):
            raise ParameterError("predictor: 'formation.trend_m' and 'trend_damping' need one number for each filter")


@dataclass(frozen=True)
class PredictorParameters:
    """Which predictor runs, and the parameters of all."""

    name: str = parameter(
        "formation",
        "Predictor; also one of another package, or 'module:Class', and these with '+close'",
        choices=NAMES,
        also=is_outside_predictor,
    )
    forgetting: float = parameter(
        1.0, "Weight of a pair relative to the next newer one ('measured'); 1 forgets nothing", low=0.01, high=1.0
    )
    max_u_m: float = parameter(0.1, "Bound of the forecast along u", unit="m", low=0.0, high=10.0)
    max_v_m: float = parameter(0.2, "Bound of the forecast along v", unit="m", low=0.0, high=10.0)
    sigma_u_m: float = parameter(
        0.0045, "Standard deviation of a forecast along u before errors tell", unit="m", low=0.0, high=1.0
    )
    sigma_v_m: float = parameter(
        0.0025, "Standard deviation of a forecast along v before errors tell", unit="m", low=0.0, high=1.0
    )
    max_turn_rad: float = parameter(0.35, "Bound of the forecast turn", unit="rad", low=0.0, high=3.2)
    sigma_turn_rad: float = parameter(
        0.01, "Standard deviation of a forecast turn before errors tell", unit="rad", low=0.0, high=3.2
    )
    sigma_weight: float = parameter(2.0, "How many forecasts these standard deviations count for", low=0.01, high=1e6)
    sigma_discount: float = parameter(
        0.9, "Weight of a past forecast's error in the covariance relative to the next newer one", low=0.01, high=1.0
    )
    state_file: str = parameter(
        "", "File that keeps what was learned, so that a restarted node goes on; {robot} is its robot; empty: none"
    )
    load_state: bool = parameter(False, "Begin with what state_file holds, if it is there")
    ewma: EwmaParameters = EwmaParameters()
    kalman_trend: TrendParameters = TrendParameters()
    edmd: EdmdParameters = EdmdParameters()
    closing: ClosingParameters = ClosingParameters()
    formation: FormationParameters = FormationParameters()
