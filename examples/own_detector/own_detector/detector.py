"""Finds the faces of the robot's marker in a picture by their colours, with OpenCV."""

import cv2
import numpy as np

# The signatures of the marker's faces (1 Target, 2 Front, 3 Rear) and their hues in OpenCV's unit, 0 to 179. Red lies
# at both ends of that scale, so all hues are turned by 30: red 30, green 90, blue 150.
TURNED_BY = 30
HUES = {1: 30, 2: 90, 3: 150}
TOLERANCE = 12
LEAST_SATURATION, LEAST_VALUE = 190, 50
LEAST_AREA = 30.0  # square pixels: smaller regions are noise


def find_faces(picture):
    """Return a box for each face that is seen: signature, column and row of its centre, width, height, in pixels.

    The picture is RGB, uint8, of shape (height, width, 3).
    """
    hsv = cv2.cvtColor(cv2.medianBlur(picture, 3), cv2.COLOR_RGB2HSV)
    hsv[:, :, 0] = (hsv[:, :, 0] + TURNED_BY) % 180
    faces = []
    for signature, hue in HUES.items():
        low = np.array([hue - TOLERANCE, LEAST_SATURATION, LEAST_VALUE])
        high = np.array([hue + TOLERANCE, 255, 255])
        outlines, _ = cv2.findContours(cv2.inRange(hsv, low, high), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        largest = max(outlines, key=cv2.contourArea, default=None)
        if largest is not None and cv2.contourArea(largest) >= LEAST_AREA:
            left, top, width, height = cv2.boundingRect(largest)
            # The camera's protocol counts from the first to the last pixel, hence one less than OpenCV's sizes.
            faces.append((signature, left + (width - 1) // 2, top + (height - 1) // 2, width - 1, height - 1))
    return faces
