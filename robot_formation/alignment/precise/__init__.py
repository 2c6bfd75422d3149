"""Alignment with a pose filter: marker edges, a bank of Kalman filters, actuation model, planner, search."""
