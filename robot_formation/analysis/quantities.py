"""The project's quantities, per timestep and of a whole run, from plain records.

displacement
    net displacement of a timestep by the follower's encoder wheels, in its frame at the timestep's start.
correction distance
    sum of |component| over the moves after the prediction move, realised by the encoder wheels; of a run: over the
    finished timesteps from 4 on (after the collection phase).
formation error
    |e| with e = p_F - p_B - R(psi_B)(a, -d): actual minus desired place of base_link in world x, y when the follower
    reports (ground truth), d to the right of the beacon neighbour B (0.32 m by default) and a ahead of it (0 by
    default; the run's slots). Over the timesteps: RMSE of
    |e|; bias, the mean of e in B's frame as u and v; scatter, the RMS distance from it. RMSE^2 = bias^2 + scatter^2.
prediction coverage
    share of the timesteps from 4 on whose ideal move, the displacement followed by the residual, lies inside the 90 %
    ellipse of the prediction (a Gaussian's in u and v, by the published covariance). Of the turn apart: inside the 90 %
    interval, where residual and prediction tell a turn.
blind timestep
    one without the camera (a blackout): its residual is unknown, its formation error is as of any other.
overhead error
    distance in world x, y between a robot's reference dot as the overhead tracker saw it and the dot's true place.
heading error
    psi_F - psi_B, between -pi and pi.

Moves by axis and kind, and losses of the neighbour, are in analysis.moves.

What is unavailable is None. Frames and signs: v = +x (forward), u = -y (to the right); turns are apart, in radians.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.chain import chain_totals, moves_of_timestep, pose, pose_at_end
from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.in_motion import motion_totals
from robot_formation.analysis.moves import Moves, is_blind, move_totals, movements_of, moves_of
from robot_formation.analysis.quantiles import ELLIPSE_90, NORMAL_90
from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Stamped
from robot_formation.analysis.string_stability import string_stability
from robot_formation.geometry.se2 import Motion, formation_error_uv_m
from robot_formation.json_values import JsonObject
from robot_formation.names import beacon_neighbour
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS


@dataclass(frozen=True)
class Corrections:
    """Moves after the prediction move: summed |u| and |v| in metres, summed |turn| in radians, their number."""

    u_m: float
    v_m: float
    turn_rad: float
    movements: int


@dataclass(frozen=True)
class Timestep:
    """A finished timestep of one follower. `error_uv_m` is the formation error as a vector in B's frame, metres."""

    t: int
    predicted: Motion | None
    moved: Motion
    corrections: Corrections
    moves: Moves
    residual: Motion | None
    predicted_turn_rad: float | None
    residual_turn_rad: float | None
    blind: bool
    error_uv_m: tuple[float, float] | None
    heading_error_rad: float | None

    @property
    def formation_error_m(self) -> float | None:
        """Length of the formation error, metres."""
        return math.hypot(*self.error_uv_m) if self.error_uv_m is not None else None

    def to_json(self) -> JsonObject:
        """Return the timestep as the command line's JSON has it."""
        return {
            "t": self.t,
            "predicted_u_m": self.predicted.u_m if self.predicted else None,
            "predicted_v_m": self.predicted.v_m if self.predicted else None,
            "moved_u_m": self.moved.u_m,
            "moved_v_m": self.moved.v_m,
            "correction_u_m": self.corrections.u_m,
            "correction_v_m": self.corrections.v_m,
            "residual_u_m": self.residual.u_m if self.residual else None,
            "residual_v_m": self.residual.v_m if self.residual else None,
            "movements": self.corrections.movements,
            "formation_error_m": self.formation_error_m,
            "heading_error_rad": self.heading_error_rad,
            "predicted_turn_rad": self.predicted_turn_rad,
            "moved_turn_rad": self.moved.yaw_rad,
            "correction_turn_rad": self.corrections.turn_rad,
            "residual_turn_rad": self.residual_turn_rad,
            "blind": self.blind,
            "moves_by_axis": self.moves.axes,
            "moves_by_kind": self.moves.kinds,
        }


@dataclass(frozen=True)
class FollowerAnalysis:
    """A follower's finished timesteps, its totals, and what happened in a timestep that it didn't finish."""

    name: str
    lost: bool
    timesteps: tuple[Timestep, ...]
    unfinished: Corrections | None
    totals: JsonObject

    def to_json(self) -> JsonObject:
        """Return the timesteps and totals as the command line's JSON has them."""
        return {"timesteps": [timestep.to_json() for timestep in self.timesteps], "totals": self.totals}


@dataclass(frozen=True)
class RunAnalysis:
    """A run's scenario, outcome (done, lost, left_plate or incomplete) and followers.

    `string_stability` is None with one follower.
    """

    scenario: str | None
    outcome: str
    followers: tuple[FollowerAnalysis, ...]
    string_stability: JsonObject | None = None

    def to_json(self) -> JsonObject:
        """Return the command line's JSON: the first follower's, and what there is more where there are several."""
        result = {"scenario": self.scenario, "outcome": self.outcome, **self.followers[0].to_json()}
        if len(self.followers) > 1:
            result["followers"] = {follower.name: follower.to_json() for follower in self.followers}
            result["string_stability"] = self.string_stability
        return result


def analyse(record: RunRecord) -> RunAnalysis:
    """Work out a run's quantities.

    Raises:
        AnalysisError: the record has no follower, or more finished timesteps than moves of the leader.
    """
    if not record.followers:
        raise AnalysisError("the run has no follower; give the record of a formation run")
    followers = tuple(analyse_follower(record, follower) for follower in record.followers)
    errors_m = [[timestep.formation_error_m for timestep in follower.timesteps] for follower in followers]
    chain = string_stability(record, errors_m)
    return RunAnalysis(record.details.get("scenario"), _outcome(record, followers), followers, chain)


def analyse_follower(record: RunRecord, follower: FollowerRecord) -> FollowerAnalysis:
    """Work out one follower's timesteps and totals.

    Raises:
        AnalysisError: there are more finished timesteps than moves of the leader (the record's start is missing).
    """
    finished, opened = len(follower.displacements), len(record.leader_moved)
    if finished > opened:
        raise AnalysisError(
            f"{follower.name} finished {finished} timesteps but the leader moved {opened} times: "
            "the record's start is missing; record the run from its beginning"
        )
    timesteps = tuple(_timestep(record, follower, t) for t in range(1, finished + 1))
    unfinished = None
    if opened > finished:
        indices = moves_of_timestep(record, follower, finished + 1)
        unfinished = corrections_of(follower, indices)
    values = totals(timesteps)
    counts = [timestep.corrections.movements for timestep in timesteps]
    values.update(move_totals([timestep.moves for timestep in timesteps], counts, follower))
    values["prediction_coverage_90"] = prediction_coverage(follower)
    values["prediction_turn_coverage_90"] = prediction_turn_coverage(follower)
    values["blind_timesteps"] = sum(timestep.blind for timestep in timesteps)
    values["formation_error_blind_max_m"] = max(
        (t.formation_error_m for t in timesteps if t.blind and t.formation_error_m is not None), default=None
    )
    values.update(chain_totals(record, follower, [t.formation_error_m for t in timesteps]))
    values["timesteps_finished"] = finished
    values["timesteps_planned"] = record.timesteps_planned
    values["unfinished_timestep"] = None
    if unfinished is not None:
        values["unfinished_timestep"] = {
            "t": finished + 1,
            "correction_u_m": unfinished.u_m,
            "correction_v_m": unfinished.v_m,
            "correction_turn_rad": unfinished.turn_rad,
            "movements": unfinished.movements,
        }
    values["path_length_m"] = {robot: track.length_m for robot, track in record.tracks.items()}
    values["overhead_error_m"] = overhead_errors(record)
    values["simulated_seconds"] = record.simulated_s
    values.update(motion_totals(record, follower))
    return FollowerAnalysis(follower.name, follower.lost, timesteps, unfinished, values)


def totals(timesteps: Sequence[Timestep]) -> JsonObject:
    """Sum up timesteps: correction distances from timestep 4 on, movements, formation and heading errors."""
    counted = [timestep.corrections for timestep in timesteps if timestep.t > COLLECTION_TIMESTEPS]
    u_m = sum(correction.u_m for correction in counted)
    v_m = sum(correction.v_m for correction in counted)
    turn_rad = sum(correction.turn_rad for correction in counted)
    movements = sum(timestep.corrections.movements for timestep in timesteps)
    errors = np.array([timestep.error_uv_m for timestep in timesteps if timestep.error_uv_m is not None])
    headings = np.array([t.heading_error_rad for t in timesteps if t.heading_error_rad is not None])
    return {
        "correction_m": u_m + v_m if counted else None,
        "correction_u_m": u_m if counted else None,
        "correction_v_m": v_m if counted else None,
        "correction_turn_rad": turn_rad if counted else None,
        "movements": movements,
        "movements_per_timestep": movements / len(timesteps) if timesteps else None,
        **_error_statistics(errors),
        "heading_error_rmse_rad": float(np.sqrt(np.mean(headings**2))) if headings.size else None,
    }


def prediction_coverage(follower: FollowerRecord) -> float | None:
    """Share of the counted timesteps whose ideal move lies in the prediction's 90 % ellipse; None if there are none."""
    inside = []
    for displacement, residual, prediction in _forecast_timesteps(follower):
        uu, uv, vv = prediction.covariance_uv
        if not (residual.motion.finite and prediction.motion.finite) or uu * vv - uv**2 <= 0.0:
            continue
        ideal = displacement.motion.then(residual.motion)
        u_m, v_m = ideal.u_m - prediction.motion.u_m, ideal.v_m - prediction.motion.v_m
        squared = (vv * u_m**2 - 2.0 * uv * u_m * v_m + uu * v_m**2) / (uu * vv - uv**2)
        inside.append(squared <= ELLIPSE_90)
    return sum(inside) / len(inside) if inside else None


def prediction_turn_coverage(follower: FollowerRecord) -> float | None:
    """Share of the counted timesteps whose ideal turn lies in the prediction's 90 % interval; None without any."""
    inside = []
    for displacement, residual, prediction in _forecast_timesteps(follower):
        if residual.turn_rad is None or prediction.turn_rad is None or prediction.turn_variance <= 0.0:
            continue
        error_rad = displacement.motion.yaw_rad + residual.turn_rad - prediction.turn_rad
        inside.append(abs(error_rad) <= NORMAL_90 * math.sqrt(prediction.turn_variance))
    return sum(inside) / len(inside) if inside else None


def _forecast_timesteps(follower: FollowerRecord) -> Iterator[tuple[Stamped, Stamped, Stamped]]:
    """Yield displacement, residual and prediction of each timestep from 4 on."""
    return zip(
        follower.displacements[COLLECTION_TIMESTEPS:],
        follower.residuals[COLLECTION_TIMESTEPS:],
        follower.predictions[COLLECTION_TIMESTEPS - 1 :],
        strict=False,
    )


def overhead_errors(record: RunRecord) -> dict[str, dict[str, float]] | None:
    """Root mean square and largest overhead error of each robot over the whole run, metres; None without a tracker."""
    errors = {robot: track.errors_m for robot, track in record.overhead.items() if len(track.stamps_ns)}
    return {
        robot: {"rms": float(np.sqrt(np.mean(found**2))), "max": float(found.max())} for robot, found in errors.items()
    } or None


def corrections_of(follower: FollowerRecord, indices: Sequence[int]) -> Corrections:
    """Sum up a timestep's moves without the first, which is the prediction move."""
    motions = [follower.moved[index].motion for index in indices[1:]]
    return Corrections(
        u_m=sum(abs(motion.u_m) for motion in motions),
        v_m=sum(abs(motion.v_m) for motion in motions),
        turn_rad=sum(abs(motion.yaw_rad) for motion in motions),
        movements=movements_of(follower, indices),
    )


def _timestep(record: RunRecord, follower: FollowerRecord, t: int) -> Timestep:
    displacement = follower.displacements[t - 1]
    left = follower.residuals[t - 1] if t <= len(follower.residuals) else None
    forecast = follower.predictions[t - 2] if 2 <= t <= len(follower.predictions) + 1 else None
    error_uv, heading_error = _ground_truth(record, follower, t)
    indices = moves_of_timestep(record, follower, t)
    return Timestep(
        t=t,
        predicted=forecast.motion if forecast and forecast.motion.finite else None,
        moved=displacement.motion,
        corrections=corrections_of(follower, indices),
        moves=moves_of(follower, indices, t),
        residual=left.motion if left and left.motion.finite else None,
        predicted_turn_rad=forecast.turn_rad if forecast else None,
        residual_turn_rad=left.turn_rad if left else None,
        blind=is_blind(follower, t),
        error_uv_m=error_uv,
        heading_error_rad=heading_error,
    )


def _ground_truth(
    record: RunRecord, follower: FollowerRecord, t: int
) -> tuple[tuple[float, float] | None, float | None]:
    """Return the formation error (u, v) in metres and the heading error in radians of timestep t, where known."""
    neighbour = beacon_neighbour(follower.name)
    stamp_ns = follower.displacements[t - 1].stamp_ns
    pose_f = pose(record, follower.name, stamp_ns)
    pose_b = pose_at_end(record, neighbour, t - 1) if record.delayed else pose(record, neighbour, stamp_ns)
    if pose_f is None or pose_b is None:
        return None, None
    heading_error = math.remainder(pose_f.yaw_rad - pose_b.yaw_rad, math.tau)
    return formation_error_uv_m(pose_f, pose_b, record.place(follower.name)), heading_error


def _error_statistics(errors_uv_m: NDArray[np.float64]) -> dict[str, float | None]:
    names = ("rmse_m", "bias_u_m", "bias_v_m", "scatter_m")
    values: list[float | None] = [None] * len(names)
    if errors_uv_m.size:
        bias = errors_uv_m.mean(axis=0)
        rmse = float(np.sqrt(np.mean(np.sum(errors_uv_m**2, axis=1))))
        scatter = float(np.sqrt(np.mean(np.sum((errors_uv_m - bias) ** 2, axis=1))))
        values = [rmse, float(bias[0]), float(bias[1]), scatter]
    return {f"formation_error_{name}": value for name, value in zip(names, values, strict=True)}


def _outcome(record: RunRecord, followers: Sequence[FollowerAnalysis]) -> str:
    if any(follower.lost for follower in followers) or record.details.get("outcome") == "lost":
        return "lost"
    if record.left_plate:
        return "left_plate"
    planned = record.timesteps_planned
    if planned is None:
        cut_short = any(follower.unfinished is not None or not follower.timesteps for follower in followers)
        return "incomplete" if cut_short else "done"
    return "done" if all(len(follower.timesteps) >= planned for follower in followers) else "incomplete"
