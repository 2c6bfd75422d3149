"""The leader: one step per timestep, then it waits for the formation."""
