"""What to do about what the camera shows: the rules of the paper, and a pose filter with a planner."""
