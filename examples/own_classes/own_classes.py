"""A predictor, a surface, a path and a sensor in a package of their own."""

import math
from dataclasses import dataclass

import cv2
import numpy as np


class Damped:
    """The last displacement, drawn towards the mean of all."""

    def __init__(self):
        self.mean = np.zeros(3)
        self.last = np.zeros(3)
        self.count = 0

    def observe(self, displacement):
        """Learn from a measured displacement: u and v in metres, turn in radians."""
        self.count += 1
        self.mean = self.mean + (displacement - self.mean) / self.count
        self.last = displacement

    def forecast(self):
        """Return the next displacement."""
        return 0.5 * (self.last + self.mean)


@dataclass(frozen=True)
class Dunes:
    """Crossed waves; slopes are taken from the heights by differences."""

    height_m: float = 0.01
    length_m: float = 0.9

    def height(self, x, y):
        """Return the height at a place, metres."""
        wave = 2.0 * math.pi / self.length_m
        return self.height_m * math.sin(wave * x) * math.cos(wave * y)


@dataclass(frozen=True)
class Zigzag:
    """Forward, and aside to the left and to the right in turn, `period` timesteps each."""

    step_m: float = 0.05
    aside_m: float = 0.01
    period: int = 4

    def motion(self, timestep):
        """Return the motion of a timestep: x forward, y left, metres."""
        left = (timestep - 1) // self.period % 2 == 0
        return self.step_m, self.aside_m if left else -self.aside_m


class Hsv:
    """OpenCV's usual way: thresholds of hue and saturation, and the bounding box of the largest region of each face."""

    hues = ((1, 0), (2, 60), (3, 120))  # signature and hue of the Target, Front and Rear faces, OpenCV's degrees / 2
    smallest = 30  # pixels

    def detect(self, picture):
        """Return signature, column and row of the centre, width and height of every face found."""
        hsv = cv2.cvtColor(cv2.medianBlur(picture, 3), cv2.COLOR_RGB2HSV)
        found = []
        for signature, hue in self.hues:
            distance = np.abs((hsv[:, :, 0].astype(int) - hue + 90) % 180 - 90)
            mask = ((distance < 12) & (hsv[:, :, 1] > 190) & (hsv[:, :, 2] > 50)).astype(np.uint8)
            count, _, stats, _ = cv2.connectedComponentsWithStats(mask)
            if count > 1:
                left, top, width, height, area = stats[1 + stats[1:, cv2.CC_STAT_AREA].argmax()].tolist()
                if area >= self.smallest:
                    found.append((signature, left + (width - 1) / 2, top + (height - 1) / 2, width - 1, height - 1))
        return found
