"""Runs to look at: what the cameras showed, where the robots truly were, and animations."""
