"""Limits of what is analysed, for whoever has to know them before NumPy is loaded."""

FARTHEST = 50
"""Most timesteps ahead whose forecasts are judged."""
