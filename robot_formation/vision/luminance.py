"""The brightness of a colour."""

from __future__ import annotations

import numpy as np

LUMINANCE_WEIGHTS = np.array([0.299, 0.587, 0.114])
"""Shares of red, green and blue in the brightness of a colour (ITU-R BT.601)."""
