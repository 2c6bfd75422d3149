"""A predictor of one's own: exponential smoothing."""

import numpy as np


class Smoothed:
    """Forecasts a mean of the displacements so far, in which each counts half as much as the one after it."""

    def __init__(self):
        self.mean = None

    def observe(self, displacement):
        """Learn from the displacement of a timestep: u and v in metres, turn in radians."""
        self.mean = displacement if self.mean is None else 0.5 * (self.mean + displacement)

    def forecast(self):
        """Return the next displacement."""
        return np.zeros(3) if self.mean is None else self.mean
