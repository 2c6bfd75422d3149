"""The robots' decisions as state machines: leader, drive, alignment, the follower's timestep."""
