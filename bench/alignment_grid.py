"""Alignments from the starts of the paper's calibration grid: which can be attained, a sample of them, its figures.

Paper, "Visual fine-tuning process calibrations": relative positions -45..45 cm in u and v every 5 cm, nine angles.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robot_formation.batch.resumable_table import ResumableTable
from robot_formation.calibration.alignment_trial import (
    FOLLOWER,
    AlignmentTrial,
    Equipment,
    Start,
    gap_m,
    poses,
)
from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.world.events import Frame
from robot_formation.world.pose import Pose
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World

PLACES_M = tuple(number * 0.05 for number in range(-9, 10))
ANGLES_DEG = (-60.0, -45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0, 60.0)
# Nobody has placed the follower in formation by hand here, so that nothing may be assumed of its heading.
CONDITIONS = ("world.camera.mode=on_demand", "world.overhead.enabled=false", "fine_tuner.precise.placed_m=0.0")
GOOD_U_M, GOOD_V_M, GOOD_HEADING_RAD, GOOD_MOVES = 0.015, 0.01, math.radians(6.0), 14
_LEAST_GAP_M = 0.005
_WIDEST_RAD = math.radians(40.0)


@dataclass(frozen=True)
class Row:
    """One alignment: its start as in `Start`, the faces seen there, and how it went as in `Trial`."""

    mode: str
    seed: int
    u_m: float
    v_m: float
    angle_deg: float
    faces: str
    outcome: str
    moves: int
    path_m: float
    touched: int
    error_u_m: float
    error_v_m: float
    error_heading_rad: float

    @property
    def good(self) -> bool:
        """Whether it ended in formation by ground truth, untouched and within the moves."""
        return (
            abs(self.error_u_m) <= GOOD_U_M
            and abs(self.error_v_m) <= GOOD_V_M
            and abs(self.error_heading_rad) <= GOOD_HEADING_RAD
            and not self.touched
            and self.moves <= GOOD_MOVES
        )


def equipment(mode: str, settings: Sequence[str] = ()) -> Equipment:
    """Take world, drive, detector and fine-tuner as configured, in a mode.

    Raises:
        FormationError: on a misspelt or wrong setting KEY=VALUE.
    """
    scenario = scenarios.override(scenarios.load_track("two"), [*CONDITIONS, *settings, f"fine_tuner.mode={mode}"])
    world = scenario.world
    return Equipment(world.make_surface(), world, scenario.drive, scenario.block_detector, scenario.fine_tuner)


def starts() -> Iterator[Start]:
    """Yield the whole grid."""
    for u_m, v_m, angle_deg in itertools.product(PLACES_M, PLACES_M, ANGLES_DEG):
        yield Start(round(u_m, 3), round(v_m, 3), angle_deg)


def faces_seen(equipment: Equipment, start: Start) -> str:
    """Tell the signatures in view from a start, like "12"; none if the bodies overlap there."""
    robots = poses(equipment.surface, start)
    leader, follower = (_flat(robot) for robot in robots)
    chassis = equipment.world.chassis
    if gap_m(leader, follower, chassis.length_m, chassis.width_m) <= _LEAST_GAP_M:
        return ""
    other = leader.planar.relative_to(follower.planar)
    if other.y_m <= 0.0 or abs(math.atan2(other.x_m, other.y_m)) > _WIDEST_RAD:
        return ""  # far outside the picture
    world = World(equipment.surface, robots, equipment.world, seed=0)
    detector = BlockDetector(equipment.detector.load(), equipment.detector)
    seen: set[int] = set()
    try:
        world.request_frames(FOLLOWER, equipment.fine_tuner.look.frames)
        while events := world.advance():
            for event in events:
                if isinstance(event, Frame):
                    seen = {b.signature for b in detector.process(event.image, event.stamp_ns // 1000)}
    finally:
        world.close()
    return "".join(str(signature) for signature in sorted(seen))


def stratified(attainable: Mapping[Start, str], count: int, seed: int) -> list[tuple[Start, int]]:
    """Choose starts and seeds: every stratum (angle, faces in view) has its share, every start in it its turn.

    The first ones of a longer sample are spread over the strata too, so that a sample that was stopped is one.
    """
    rng = np.random.default_rng(seed)
    strata: dict[tuple[float, str], list[Start]] = defaultdict(list)
    for start in sorted(attainable, key=lambda s: (s.angle_deg, s.u_m, s.v_m)):
        strata[start.angle_deg, attainable[start]].append(start)
    total, ranked = len(attainable), []
    for _, members in sorted(strata.items()):
        share = math.ceil(count * len(members) / total)
        rounds = math.ceil(share / len(members))
        order = np.concatenate([rng.permutation(len(members)) for _ in range(rounds)])[:share]
        offset = rng.random()
        ranked += [((place + offset) / len(members), members[index]) for place, index in enumerate(order)]
    ranked.sort(key=lambda pair: pair[0])
    return [(start, seed * 1_000_000 + number) for number, (_, start) in enumerate(ranked[:count])]


def run_start(equipment: Equipment, mode: str, start: Start, faces: str, seed: int) -> Row:
    """Carry out one alignment."""
    trial = AlignmentTrial(equipment, start, seed).run()
    return Row(
        mode,
        seed,
        start.u_m,
        start.v_m,
        start.angle_deg,
        faces,
        trial.outcome,
        trial.moves,
        trial.path_m,
        int(trial.touched),
        *trial.errors,
    )


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """Tell the share of good ends, and median and 95 % point of moves, path and absolute errors; SI units."""
    values: dict[str, list[float]] = {
        "moves": [row.moves for row in rows],
        "path_m": [row.path_m for row in rows],
        "error_u_m": [abs(row.error_u_m) for row in rows],
        "error_v_m": [abs(row.error_v_m) for row in rows],
        "error_heading_rad": [abs(row.error_heading_rad) for row in rows],
    }
    summary: dict[str, Any] = {
        "starts": len(rows),
        "good": sum(row.good for row in rows) / len(rows),
        "aligned": sum(row.outcome == "aligned" for row in rows) / len(rows),
        "lost": sum(row.outcome == "lost" for row in rows) / len(rows),
        "touched": sum(row.touched for row in rows) / len(rows),
        "within_moves": sum(row.moves <= GOOD_MOVES for row in rows) / len(rows),
    }
    for name, found in values.items():
        summary[name] = {"median": float(np.median(found)), "p95": float(np.quantile(found, 0.95))}
    return summary


def table(path: Path) -> ResumableTable[Row]:
    """Return a table of alignments."""
    return ResumableTable(path, Row, FormationError, "no table of alignments; choose another file")


def _flat(start: RobotStart) -> Pose:
    half = 0.5 * start.heading_rad
    return Pose((start.x_m, start.y_m, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
