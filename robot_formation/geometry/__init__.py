"""Plane and space geometry that every other part shares: SE(2) motions, orientations, footprints."""
