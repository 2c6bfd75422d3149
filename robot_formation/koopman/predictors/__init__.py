"""Predictors of the follower's next displacement."""

from robot_formation.koopman.predictors.parameters import NAMES, PredictorParameters
from robot_formation.koopman.predictors.predictor import MODELS, Forecast, PredictionError, Predictor

__all__ = ["MODELS", "NAMES", "Forecast", "PredictionError", "Predictor", "PredictorParameters"]
