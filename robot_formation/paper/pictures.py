"""All of the paper's figures into one folder, each by its name in `statements.FIGURES`."""

from __future__ import annotations

import shutil
from pathlib import Path

from robot_formation.calibration.camera_files import picture_paths
from robot_formation.calibration.motor_figures import draw_encoders, draw_motors
from robot_formation.paper.diagrams import draw_scheme, draw_visual_flow
from robot_formation.paper.figures import draw_correction_pairs, draw_illustration, draw_manifold, draw_trajectories
from robot_formation.paper.work import SEED, Results, Work
from robot_formation.surface import make_surface


def draw_all(results: Results, work: Work, picture_format: str) -> dict[str, Path]:
    """Draw every figure; return the files by the figures' names.

    Raises:
        AnalysisError: a file can't be written.
    """

    def at(name: str) -> Path:
        return work.folder / f"{name}.{picture_format}"

    scenario = results.scenario
    body = (scenario.world.chassis.length_m, scenario.world.chassis.width_m)
    distance = scenario.fine_tuner.formation_distance_m
    found = {
        "trajectories": draw_trajectories(results.drawn, at("trajectories")),
        "corrections": draw_correction_pairs(results.drawn, at("corrections")),
        "motors": draw_motors(results.fits, f"Motor calibration · seed {SEED}, plane", at("motors")),
        "encoders": draw_encoders(results.encoders, f"Travelled distances · seed {SEED}, plane", at("encoders")),
        "manifold": draw_manifold(make_surface("bowl"), scenario.plate_m, at("manifold")),
        "illustration": draw_illustration(results.drawn, body, distance, at("illustration")),
        "scheme": draw_scheme(at("scheme")),
        "visual_flow": draw_visual_flow(scenario.fine_tuner.alignment, at("visual_flow")),
    }
    for name, drawn in picture_paths(work.folder / "vision", picture_format).items():
        found[f"vision_{name}"] = Path(shutil.copy(drawn, at(f"vision_{name}")))
    return found
