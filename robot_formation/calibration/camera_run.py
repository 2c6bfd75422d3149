"""Camera calibration: looks at the whole grid on several cores.

Paper, section "Visual fine-tuning process calibrations".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import BrokenExecutor

from robot_formation.batch.pool import run_parallel
from robot_formation.calibration.camera_grid import Conditions, Position, measure
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.drive.curves import CalibrationError
from robot_formation.parameters import to_mapping

BAG_NAME = "vision_bag"


# What the looks' results depend on, of the world's parameters.
_WORLD = ("surface", "chassis.", "wheels.", "camera.", "marker.")


def record_of(conditions: Conditions, step_m: float) -> dict[str, object]:
    """List by name all that the looks' results depend on."""
    return {
        "step_m": step_m,
        "seed": conditions.seed,
        **{f"world.{name}": value for name, value in to_mapping(conditions.world).items() if name.startswith(_WORLD)},
        **to_mapping(conditions.detector, "block_detector."),
        **to_mapping(conditions.look, "fine_tuner.look."),
    }


def carry_out(positions: Iterable[Position], conditions: Conditions, jobs: int) -> Iterator[list[CameraSample]]:
    """Look at all positions, on several cores by joblib; yields each position's samples, in order.

    Raises:
        CalibrationError: if a worker process dies.
    """
    try:
        yield from run_parallel(measure, ((position, conditions) for position in positions), jobs)
    except BrokenExecutor:
        raise CalibrationError(
            f"a worker process died (too little memory for --jobs {jobs}?); the same command goes on"
        ) from None
