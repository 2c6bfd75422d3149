"""Robot formation control on an unknown curved surface by Koopman prediction and a Pixy2 camera."""

__version__ = "0.1.0"
