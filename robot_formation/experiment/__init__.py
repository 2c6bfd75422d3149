"""Scenarios, in-process runs, and what a run on this machine needs."""
