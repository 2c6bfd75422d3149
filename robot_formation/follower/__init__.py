"""The follower's state machine: predict, move, look, correct."""
