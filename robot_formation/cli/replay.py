"""`formation replay`: a recorded run once more through today's predictor, fine-tuner or detector, without ROS."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation.cli.parser import Subparsers
from robot_formation.errors import FormationError, shown
from robot_formation.json_values import Json, JsonObject

if TYPE_CHECKING:
    from robot_formation.experiment.recorded_run import Recording
    from robot_formation.experiment.replay import DetectionReplay, PredictionReplay
    from robot_formation.experiment.replay_fine_tuner import Decisions, FineTunerReplay
    from robot_formation.geometry.se2 import Motion

DESCRIPTION = """\
Run what a bag holds through today's code again and show what would have changed: displacements through the predictor
(default), blocks through the fine-tuner, or pictures through the detector. Parameters are those of the recording unless
--set changes them. Nothing is simulated: each answer is to what was recorded, not to what would have followed.
"""
_MOST_ROWS = 20


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser(
        "replay", help="recorded data through today's predictor, fine-tuner or detector", description=DESCRIPTION
    )
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag of a run")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--predictor", metavar="NAME", help="displacements through this predictor (default: the recorded)"
    )
    what.add_argument("--fine-tuner", action="store_true", help="blocks through the fine-tuner")
    what.add_argument(
        "--detector", "--images", action="store_true", help="pictures through the detector ('formation run --images')"
    )
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="a parameter of that node; may be repeated"
    )
    parser.add_argument(
        "--namespace", metavar="NS", help="the formation's namespace, where the bag holds several formations"
    )
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Replay and print; return 0, whether anything changed or not.

    Raises:
        FormationError: the bag can't be read or lacks what is needed, or a setting is wrong.
    """
    from robot_formation.bag.reader import read_bag
    from robot_formation.experiment.recorded_run import Recording

    kind = "fine_tuner" if args.fine_tuner else "block_detector" if args.detector else "predictor"
    changes = _changes(kind, args.set)
    if args.predictor is not None:
        changes["name"] = args.predictor
    with read_bag(args.bag) as bag:
        recording = Recording(bag, args.namespace)
        data, text = _REPLAYS[kind](recording, changes)
    for note in recording.notes:
        print(f"note: {note}", file=sys.stderr)
    if args.json:
        found = {"bag": str(args.bag), "node": kind, "changes": changes, "followers": data, "notes": recording.notes}
        print(json.dumps(found, indent=2, allow_nan=False))
    else:
        print(text)
    return 0


def _changes(kind: str, settings: Sequence[str]) -> JsonObject:
    """Read --set as `formation run` does; settings of other nodes are refused."""
    from robot_formation.system.yaml_files import YamlError, parse_yaml

    found = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        node, _, name = key.partition(".")
        if not (equals and name and node == kind):
            raise FormationError(
                f"--set takes a parameter of the node that is replayed, {kind}.NAME=VALUE, not '{setting}'"
            )
        try:
            found[name] = parse_yaml(text)
        except YamlError as error:
            raise FormationError(f"--set {key}: {shown(text)} is no YAML value: {error.problem}") from None
    return found


def _predictor(recording: Recording, changes: JsonObject) -> tuple[Json, str]:
    from robot_formation.experiment.replay import replay_predictor

    found = replay_predictor(recording, changes)
    return [_prediction_json(replay) for replay in found], "\n\n".join(_prediction_text(replay) for replay in found)


def _prediction_json(replay: PredictionReplay) -> JsonObject:
    return {
        "robot": replay.robot,
        "identical": replay.identical,
        "changed": replay.changed,
        "rmse_recorded_m": replay.rmse_m("recorded"),
        "rmse_today_m": replay.rmse_m("today"),
        "timesteps": [
            {
                "t": row.timestep,
                **_uv("recorded", row.recorded),
                **_uv("today", row.today),
                **_uv("ideal", row.ideal),
            }
            for row in replay.rows
        ],
    }


def _prediction_text(replay: PredictionReplay) -> str:
    lines = [
        f"{replay.robot}: predictions and the move that would have been right (displacement and residual), cm",
        "",
        "        recorded           today           ideal        ",
        "  t       u      v       u      v       u      v",
    ]
    for row in replay.rows:
        cells = " ".join(_cells(motion) for motion in (row.recorded, row.today, row.ideal))
        lines.append(f"{row.timestep:>3}  {cells}{'' if row.recorded == row.today else '  changed'}")
    lines.append("")
    for which in ("recorded", "today"):
        rmse_m = replay.rmse_m(which)
        lines.append(f"RMSE {which:<9} " + ("-" if rmse_m is None else f"{rmse_m * 100:.2f} cm"))
    return "\n".join([*lines, _verdict(replay.identical, replay.changed, len(replay.rows), "timesteps")])


def _fine_tuner(recording: Recording, changes: JsonObject) -> tuple[Json, str]:
    from robot_formation.experiment.replay_fine_tuner import replay_fine_tuner

    found = replay_fine_tuner(recording, changes)
    return [_decisions_json(replay) for replay in found], "\n\n".join(_decisions_text(replay) for replay in found)


def _decisions_json(replay: FineTunerReplay) -> JsonObject:
    def decided(decisions: Decisions) -> JsonObject:
        moves = [{"u_m": move.u_m, "v_m": move.v_m, "yaw_rad": move.yaw_rad} for move in decisions.moves]
        return {"states": list(decisions.states), "moves": moves}

    return {
        "robot": replay.robot,
        "identical": replay.identical,
        "changed": replay.changed,
        "timesteps": [
            {
                "t": row.timestep,
                "recorded": decided(row.recorded),
                "today": decided(row.today),
                "beyond_record": row.beyond,
            }
            for row in replay.rows
        ],
    }


def _decisions_text(replay: FineTunerReplay) -> str:
    lines = [f"{replay.robot}: corrections that were asked for; 'correct' at the end: it would have gone on", ""]
    width = max((len(_decided(row.recorded)) for row in replay.rows), default=0)
    lines.append(f"  t  {'recorded':<{width}}  today")
    for row in replay.rows:
        today = _decided(row.today) if row.changed else "the same"
        lines.append(f"{row.timestep:>3}  {_decided(row.recorded):<{width}}  {today}")
    return "\n".join([*lines, "", _verdict(replay.identical, replay.changed, len(replay.rows), "timesteps")])


def _decided(decisions: Decisions) -> str:
    moves = decisions.corrections
    u_m, v_m = (sum(abs(getattr(move, axis)) for move in moves) for axis in ("u_m", "v_m"))
    return f"{len(moves)} moves, u {u_m * 100:.2f} cm, v {v_m * 100:.2f} cm, {decisions.outcome}"


def _detector(recording: Recording, changes: JsonObject) -> tuple[Json, str]:
    from robot_formation.experiment.replay import replay_detector

    found = replay_detector(recording, changes)
    return [_blocks_json(replay) for replay in found], "\n\n".join(_blocks_text(replay) for replay in found)


def _blocks_json(replay: DetectionReplay) -> JsonObject:
    def listed(blocks: Json) -> Json:
        return None if blocks is None else [dataclasses.asdict(block) for block in blocks]

    return {
        "robot": replay.robot,
        "identical": replay.identical,
        "frames": len(replay.rows),
        "changed": replay.changed,
        "changes": [
            {"stamp_ns": row.stamp_ns, "recorded": listed(row.recorded), "today": listed(row.today)}
            for row in replay.rows
            if row.changed
        ],
    }


def _blocks_text(replay: DetectionReplay) -> str:
    lines = [f"{replay.robot}: blocks of {len(replay.rows)} pictures (signature: x, y, width, height)"]
    changed = [row for row in replay.rows if row.changed]
    for row in changed[:_MOST_ROWS]:
        lines.append(f"{row.stamp_ns / 1e9:>12.6f} s  recorded {_boxes(row.recorded)}  today {_boxes(row.today)}")
    if len(changed) > _MOST_ROWS:
        lines.append(f"... and {len(changed) - _MOST_ROWS} more")
    unseen = sum(row.recorded is None for row in replay.rows)
    if unseen:
        lines.append(f"{unseen} pictures have no recorded blocks to compare with")
    return "\n".join([*lines, _verdict(replay.identical, replay.changed, len(replay.rows), "pictures")])


def _boxes(blocks: Json) -> str:
    return "; ".join(f"{b.signature}: {b.x}, {b.y}, {b.width}, {b.height}" for b in blocks or ()) or "nothing"


def _verdict(identical: bool, changed: int, count: int, what: str) -> str:
    if identical:
        return f"identical to the recording in all {count} {what}"
    return f"changed in {changed} of {count} {what}"


def _cells(motion: Motion | None) -> str:
    return " " * 7 + "-" + " " * 7 if motion is None else f"{motion.u_m * 100:>7.2f}{motion.v_m * 100:>7.2f} "


def _uv(name: str, motion: Motion | None) -> dict[str, float | None]:
    return {
        f"{name}_u_m": None if motion is None else motion.u_m,
        f"{name}_v_m": None if motion is None else motion.v_m,
    }


_REPLAYS: dict[str, Callable[[Recording, JsonObject], tuple[Json, str]]] = {
    "predictor": _predictor,
    "fine_tuner": _fine_tuner,
    "block_detector": _detector,
}
