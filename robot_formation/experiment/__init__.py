"""Scenarios, runs in one process, sweeps, and replays of recorded runs."""
