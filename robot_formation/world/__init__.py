"""Simulated robots and cameras on a surface: bodies, traction, motors, encoders, pictures, and the rule of time."""
