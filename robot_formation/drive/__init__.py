"""A robot's movement and sensing system: from distances to wheel rotations and back, and its calibrated curves."""
