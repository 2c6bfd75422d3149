"""Pictures and parameters of the detector from files."""

from __future__ import annotations

import io
import re
import tempfile
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from robot_formation.errors import shown
from robot_formation.json_values import Json, JsonObject
from robot_formation.parameters import ParameterError, from_mapping
from robot_formation.system.files import read_file
from robot_formation.system.png_files import png_head, unpacks_within
from robot_formation.system.standard_error import diverted_stderr
from robot_formation.system.yaml_files import read_yaml
from robot_formation.vision.pixy2.parameters import SIGNATURES, DetectorParameters
from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH, Picture, PictureError
from robot_formation.vision.pixy2.scaling import same_shape, scaled

CAMERA_PARAMETERS = {
    "camera_brightness",
    "auto_exposure_correction",
    "auto_white_balance",
    "auto_white_balance_on_power_up",
    "flicker_avoidance",
    "min_frames_per_second",
}
"""What PixyMon offers beside the detector's parameters: it acts on how a picture is taken, in the world's camera."""
_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP", "PPM", "GIF")
_MOST_PIXELS = 50_000_000
_MOST_BYTES = 256 << 20
_MOST_HEAD_BYTES = 1 << 20
_MOST_COMPLAINTS = 4096
_RANGE = re.compile(rf"signature_([1-{SIGNATURES}])_range")


def read_picture(path: str | Path, warn: Callable[[str], None]) -> Picture:
    """Read an image file as the camera's picture, shape (208, 316, 3), RGB.

    Args:
        path: PNG, JPEG, BMP, TIFF, WebP, PNM or GIF, of at most 50 million pixels.
        warn: told in one line each if the image is damaged, or has another size and is scaled.

    Raises:
        PictureError: if the file can't be read, holds no image, or is too large.
    """
    try:
        content = read_file(path, _MOST_BYTES)
    except OSError as error:
        raise PictureError(f"{path}: can't be read ({error.strerror}); give an image file") from error
    image, complaints = _decoded(content) if _is_small(content, path) else (None, [])
    if image is None:
        raise PictureError(f"{path}: holds no image that can be read; give a PNG, JPEG, BMP, TIFF or WebP file")
    if complaints:
        warn(f"{path}: damaged, used as far as it can be read ({complaints[0]:.100})")
    height, width = image.shape[:2]
    if (width, height) != (WIDTH, HEIGHT):
        bars = "" if same_shape(image) else ", the rest of it black, since its shape is another"
        warn(f"{path}: {width} x {height} pixels, scaled to {WIDTH} x {HEIGHT}{bars}")
    return np.ascontiguousarray(scaled(image)[:, :, ::-1])


def _is_small(content: bytes, path: str | Path) -> bool:
    """Check an image's size by its head, for a small file can claim to be huge; False if it is no image.

    Raises:
        PictureError: if it has too many pixels.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow warns of sizes too
        try:
            with Image.open(io.BytesIO(_head(content)), formats=_FORMATS) as image:
                width, height = image.size
        except Image.DecompressionBombError:
            raise _too_large(path) from None
        except Exception:  # Pillow's parsers have no common error
            return False
    if width * height > _MOST_PIXELS:
        raise _too_large(path)
    head = png_head(content)
    return head is None or unpacks_within(content, head.data_bytes)


def _head(content: bytes) -> bytes:
    """Leave away what Pillow would look through byte by byte for a marker of JPEG."""
    return content[:_MOST_HEAD_BYTES] if content.startswith(b"\xff\xd8") else content


def _too_large(path: str | Path) -> PictureError:
    return PictureError(f"{path}: has more than {_MOST_PIXELS:,} pixels; scale it down to {WIDTH} x {HEIGHT}")


def check_readable(path: str | Path) -> None:
    """Check that there is a file to read a picture from, before anything else is looked at.

    Raises:
        PictureError: if there is none.
    """
    if not Path(path).is_file():
        reason = "No such file" if not Path(path).exists() else "it is no file"
        raise PictureError(f"{path}: can't be read ({reason}); give an image file")


def _decoded(content: bytes) -> tuple[Picture | None, list[str]]:
    """Decode an image file's bytes: BGR or None, and what the image libraries complain about."""
    with tempfile.TemporaryFile() as printed:
        with diverted_stderr(printed):  # image libraries print about damaged files
            try:
                image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
            except (cv2.error, MemoryError):
                image = None
        printed.seek(0)
        lines = printed.read(_MOST_COMPLAINTS).decode(errors="replace").splitlines()
    picture = None if image is None else image.astype(np.uint8, copy=False)
    return picture, [line for line in lines if line.strip()]


def read_parameters(path: str | Path, warn: Callable[[str], None]) -> DetectorParameters:
    """Read detector parameters from a YAML or JSON file with any subset of them; the others keep their defaults.

    Names may be written as here or as in PixyMon ("Min block area", "Signature 1 range").

    Args:
        path: the file.
        warn: told in one line if the file holds parameters of the camera, which have no effect on taken pictures.

    Raises:
        ParameterError: if the file can't be read, or a name or value is wrong.
    """
    content = read_yaml(path, refuse=ParameterError, remedy="give a YAML or JSON file")
    if not isinstance(content, Mapping) or not all(isinstance(name, str) for name in content):
        raise ParameterError(f"{path}: holds no parameters; give lines like 'min_block_area: 20'")
    values = _by_own_names(content, str(path))
    of_camera = [name for name in values if name in CAMERA_PARAMETERS]
    if of_camera:
        warn(
            f"{path}: {', '.join(of_camera)}: no effect on a picture that is taken already; they are parameters of "
            "the world's camera"
        )
    own = {name: value for name, value in values.items() if name not in CAMERA_PARAMETERS}
    return from_mapping(DetectorParameters, own, where=str(path))


def _by_own_names(content: Mapping[str, Json], where: str) -> JsonObject:
    """Parameters by our names: in lower case with underscores, the signatures' ranges in one list."""
    values: JsonObject = {}
    ranges: dict[int, Json] = {}
    for given, value in content.items():
        name = "_".join(re.findall("[a-z0-9]+", given.lower()))
        single = _RANGE.fullmatch(name)
        known: dict[Json, Json] = ranges if single else values
        key = int(single[1]) if single else name or given
        if key in known:
            raise ParameterError(f"{where}: {shown(given)} is given twice; keep one of them")
        known[key] = value
    if ranges:
        if "signature_range" in values:
            raise ParameterError(f"{where}: give either 'signature_range' or the signatures' ranges one by one")
        default = DetectorParameters().signature_range
        values["signature_range"] = [ranges.get(number + 1, value) for number, value in enumerate(default)]
    return values
