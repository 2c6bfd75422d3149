"""When the robots of a formation begin a timestep: schedules, spacing, and the rules that follow from them."""
