"""Runs side by side, and reports of runs and sweeps as one HTML page."""
