"""What a camera's calibration leaves in its folder: bag, pictures and the fine-tuner's values."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from robot_formation.bag.bag_path import PARTIAL_SUFFIX
from robot_formation.calibration.camera_areas_figure import draw_areas
from robot_formation.calibration.camera_check import camera_facts
from robot_formation.calibration.camera_curve_figures import draw_pan, draw_side
from robot_formation.calibration.camera_edge_bias import edge_biases
from robot_formation.calibration.camera_fit import face_views, fit_camera
from robot_formation.calibration.camera_grid import Conditions, true_faces
from robot_formation.calibration.camera_report import VisionResult
from robot_formation.calibration.camera_run import BAG_NAME, record_of
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.follower.camera_calibration_file import VisionCalibration, save_vision

CALIBRATION_FILE = "vision.yaml"
_PICTURES = ("areas", "pan", "side")


def picture_paths(folder: Path, picture_format: str) -> dict[str, Path]:
    """Return where a calibration's pictures lie, by what they show: areas, pan, side."""
    return {name: folder / f"vision_{name}.{picture_format}" for name in _PICTURES}


def evaluate(
    conditions: Conditions,
    samples: Sequence[CameraSample],
    folder: Path,
    step_m: float,
    u_tolerance_m: float,
    picture_format: str,
) -> VisionResult:
    """Fit the curves and write all files; the curves come last because they may not be found.

    Args:
        conditions: of the looks.
        samples: of the whole grid.
        folder: where to; a bag that is there is kept.
        step_m: of the grid.
        u_tolerance_m: of the fine-tuner, shown in a picture.
        picture_format: png, svg or pdf.

    Raises:
        FormationError: a file can't be written, or the curves can't be fitted.
    """
    bag = folder / BAG_NAME
    if not bag.exists():
        from robot_formation.calibration.camera_bag import write_bag  # the only part that needs ROS

        shutil.rmtree(bag.with_name(BAG_NAME + PARTIAL_SUFFIX), ignore_errors=True)  # of a run that was stopped
        metadata = {"calibration": "vision", "conditions": json.dumps(record_of(conditions, step_m))}
        write_bag(bag, samples, conditions, metadata)
    pictures = picture_paths(folder, picture_format)
    world = conditions.world
    told = f"seed {conditions.seed}, {world.surface}"
    edge = world.marker.edge_m
    body = (world.chassis.length_m, world.chassis.width_m)
    draw_areas(samples, body, edge, f"Blocks around the beacon neighbour · {told}", pictures["areas"])
    views = face_views(samples)
    edges = edge_biases((sample, true_faces(world, sample)) for sample in samples if sample.blocks)
    result = VisionResult(samples, views, fit_camera(views, edge), edges)
    measured_with = {"seed": conditions.seed, "surface": world.surface, "step_m": step_m, **camera_facts(world)}
    save_vision(folder / CALIBRATION_FILE, VisionCalibration(result.fit.alignment(), measured_with))
    distances, compared = result.distances()
    draw_pan(result.fit, views, distances, compared, f"Pan curves · {told}", pictures["pan"])
    draw_side(result.fit, views, u_tolerance_m, f"Side length beside the neighbour · {told}", pictures["side"])
    return result
