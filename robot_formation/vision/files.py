"""Pictures and parameters of the detector from files, and pictures with their blocks drawn in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import cv2
import numpy as np
import yaml

from robot_formation.parameters import ParameterError, from_mapping
from robot_formation.vision.block import Block
from robot_formation.vision.parameters import DetectorParameters
from robot_formation.vision.picture import HEIGHT, WIDTH, Picture, PictureError

_DRAWN_SCALE = 3


def read_picture(path: str | Path, warn: Callable[[str], None]) -> Picture:
    """Read an image file as the camera's picture, shape (208, 316, 3), RGB.

    Args:
        path: any format that OpenCV reads.
        warn: told in one line if the image has another size and is scaled.

    Raises:
        PictureError: if the file can't be read or holds no image.
    """
    try:
        content = np.frombuffer(Path(path).read_bytes(), np.uint8)
    except OSError as error:
        raise PictureError(f"{path}: can't be read ({error.strerror}); give an image file") from error
    try:
        image = cv2.imdecode(content, cv2.IMREAD_COLOR) if len(content) else None
    except cv2.error:
        image = None
    if image is None:
        raise PictureError(f"{path}: holds no image that OpenCV can read; give a PNG, JPEG, BMP, TIFF or WebP file")
    height, width = image.shape[:2]
    if (width, height) != (WIDTH, HEIGHT):
        warn(f"{path}: {width} x {height} pixels, scaled to {WIDTH} x {HEIGHT}")
        image = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(image[:, :, ::-1])


def read_parameters(path: str | Path) -> DetectorParameters:
    """Read detector parameters from a YAML or JSON file with any subset of them; the others keep their defaults.

    Raises:
        ParameterError: if the file can't be read, or a name or value is wrong.
    """
    try:
        content = yaml.safe_load(Path(path).read_bytes())
    except OSError as error:
        raise ParameterError(f"{path}: can't be read ({error.strerror}); give a YAML or JSON file") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ParameterError(f"{path}: is neither YAML nor JSON ({' '.join(str(error).split())[:120]})") from error
    if not isinstance(content, Mapping) or not all(isinstance(name, str) for name in content):
        raise ParameterError(f"{path}: holds no parameters; give lines like 'min_block_area: 20'")
    return from_mapping(DetectorParameters, content, where=str(path))


def write_drawn(path: str | Path, picture: Picture, blocks: Iterable[Block]) -> None:
    """Write the picture, three times as large, with the blocks' outlines, signatures and indices.

    Raises:
        PictureError: if the file can't be written.
    """
    image = cv2.resize(picture[:, :, ::-1], None, fx=_DRAWN_SCALE, fy=_DRAWN_SCALE, interpolation=cv2.INTER_NEAREST)
    for block in blocks:
        left = (block.x - block.width // 2) * _DRAWN_SCALE
        top = (block.y - block.height // 2) * _DRAWN_SCALE
        corner = (left + block.width * _DRAWN_SCALE, top + (block.height + 1) * _DRAWN_SCALE)
        cv2.rectangle(image, (left, top), corner, (255, 255, 255), 1)
        text = f"s={block.signature:o} i={block.index}"
        cv2.putText(image, text, (left, max(top - 4, 12)), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1)
    content = cv2.imencode(".png", image)[1]
    try:
        Path(path).write_bytes(content.tobytes())
    except OSError as error:
        raise PictureError(f"{path}: can't be written ({error.strerror}); choose another folder") from error
