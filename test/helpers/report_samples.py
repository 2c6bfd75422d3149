"""What reports are tried on: the sample bags, runs that were made up, and a sweep's folder without any run."""

from pathlib import Path

from repository import ROOT
from robot_formation.experiment.sweep import Plan, Row, Table

SAMPLES = ROOT / "bags" / "samples"
PREVIOUS, MEASURED = SAMPLES / "track_two_previous", SAMPLES / "track_two_measured"


def made_up_sweep(
    folder: Path, *, surfaces: tuple[str, ...] = ("bowl", "ripple"), seeds: int = 6, lost: bool = True
) -> Path:
    """Write a sweep of two predictors: `measured` corrects half as much as `previous`, and is lost with one seed."""
    plan = Plan(("one",), surfaces, ("previous", "measured"), tuple(range(seeds)), ("predictor.forgetting=0.9",))
    table = Table(folder, plan)
    for task in plan.tasks():
        share = 0.5 if task.predictor == "measured" else 1.0
        correction_m = share * (0.10 + 0.01 * task.seed)
        ended = lost and task.predictor == "measured" and task.seed == 2
        sizes = (correction_m, 0.6 * correction_m, 0.4 * correction_m, 0.01, 1.5, 0.01 + 0.001 * task.seed, 0.02, 0.9)
        table.add(Row(*task, "lost" if ended else "done", 4 if ended else 15, *sizes))
    return folder
