"""The overhead camera: its calibration, the robots' reference dots, and their tracks."""
