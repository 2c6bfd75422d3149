"""The fine-tuner's camera calibration is what the detector shows of the world's marker on level ground."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.parameters import from_mapping, specs
from robot_formation.paths import config_dir
from robot_formation.surface import make_surface
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.boxes import Box
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.signatures import load_signatures, teach_region
from robot_formation.world.camera import Camera
from robot_formation.world.marker_picture import marker_picture
from robot_formation.world.pose import pose_on_surface
from robot_formation.world.sensor import Sensor

WORLD = from_mapping(WorldNodeParameters, node_defaults("world"), where="config/world.yaml")
FACE = np.array([[x, -0.03, z] for x in (-0.03, 0.03) for z in (0.156, 0.216)])
SIGNATURES = load_signatures(config_dir() / "signatures.yaml")


def paper_detector() -> BlockDetector:
    values = {
        name: value for name, value in node_defaults("block_detector").items() if name in specs(DetectorParameters)
    }
    return BlockDetector(SIGNATURES, from_mapping(DetectorParameters, values, where="config/block_detector.yaml"))


def looks(count: int) -> Iterator[tuple[float, float, Box]]:
    """Depth and true column of the Target face, and the block seen, at places about the formation's."""
    plane, generator = make_surface("plane"), np.random.default_rng(3)
    camera, detector = Camera(plane, WORLD), paper_detector()
    for number in range(count):
        heading = generator.uniform(-math.pi, math.pi)
        right, ahead = 0.32 + generator.uniform(-0.05, 0.05), generator.uniform(-0.008, 0.008)
        c, s = math.cos(heading), math.sin(heading)
        seen = pose_on_surface(plane, 0.9, 0.9, heading + generator.uniform(-0.03, 0.03))
        looking = pose_on_surface(plane, 0.9 + s * right + c * ahead, 0.9 - c * right + s * ahead, heading)
        corners = FACE @ seen.matrix().T + np.array(seen.position)
        rotation, lens = camera.optical_frame(looking)
        sensor = Sensor(WORLD.camera, number, "follower_1")
        picture = sensor.expose(sensor.develop(camera.light(looking, [seen])), 0.0)
        (block,) = (block for block in detector.detect(picture) if block.signature == Face.TARGET)
        depth = float((corners - lens).mean(axis=0) @ rotation[2])
        yield depth, float(camera.project(looking, corners)[:, 0].mean()), block


def test_column_and_side_length_are_calibrated_to_a_third_of_a_pixel() -> None:
    p = AlignmentParameters()
    found = [
        (block.x - column, p.side_px_m / depth - max(block.width, block.height)) for depth, column, block in looks(60)
    ]
    column_bias, side_bias = np.mean(found, axis=0)
    assert WORLD.camera.centre_x_px + column_bias == pytest.approx(p.target_x_px, abs=0.3)
    assert side_bias == pytest.approx(p.side_bias_px, abs=0.3)


def test_the_signatures_in_config_are_taught_from_the_worlds_marker() -> None:
    for sig, face in enumerate(("target", "front", "rear"), 1):
        taught = teach_region(marker_picture(WORLD, face), (136, 32, 44, 44), sig)
        stored = next(signature for signature in SIGNATURES if signature.sig == sig)
        # A grey level more or less of the noise is about 100 units.
        for name in ("u_min", "u_max", "v_min", "v_max"):
            assert getattr(stored, name) == pytest.approx(getattr(taught, name), abs=150), name
