"""Calibrating a robot's drive and its camera: rig, measurements, fits, files' checks, reports and figures."""
