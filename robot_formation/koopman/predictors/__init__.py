"""Predictors of the follower's next displacement."""

from robot_formation.koopman.predictors.horizon import Ahead
from robot_formation.koopman.predictors.parameters import NAMES, PredictorParameters, check_predictor_name
from robot_formation.koopman.predictors.predictor import DESCRIPTIONS, MODELS, Forecast, PredictionError, Predictor

__all__ = [
    "DESCRIPTIONS",
    "MODELS",
    "NAMES",
    "Ahead",
    "Forecast",
    "PredictionError",
    "Predictor",
    "PredictorParameters",
    "check_predictor_name",
]
