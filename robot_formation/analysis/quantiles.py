"""The 90 % quantiles of normal distributions in one and two dimensions."""

from __future__ import annotations

import math
from statistics import NormalDist

NORMAL_90 = NormalDist().inv_cdf(0.95)
"""90 % of a normal distribution lie within so many standard deviations to either side of its mean."""
ELLIPSE_90 = -2.0 * math.log(0.1)
"""Squared Mahalanobis distance of a 90 % ellipse: the quantile of chi-square with two degrees of freedom, whose
distribution function is 1 - exp(-x / 2)."""
