"""Digests of whole runs, to the last bit: whether a change of the code has changed what the robots do.

Every scenario below runs in this process. For each topic of the run its messages go, in order, into one digest: stamps,
moves, displacements, residuals, forecasts with covariance, ticks, ground truth. States in words and diagnostics are
left out. `bench/run_digests.json` holds the digests of the last change that was meant to change runs; the command
compares with it and names what differs. Digests hold for one kind of machine and one set of library versions: on
another machine, write them anew from the commit before the change.

Run: python bench/run_digests.py [--write] [--only TEXT] [--jobs N]
"""

from __future__ import annotations

import argparse
import hashlib
import json
import struct
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import InProcessRun

STORE = Path(__file__).with_suffix(".json")
DIGITS = 16
TOPICS = (
    "move",
    "moved",
    "displacement",
    "residual",
    "commanded",
    "prediction",
    "done",
    "odom",
    "blocks",
    "left_plate",
)
"""Last parts of the names of the topics that count."""

SCENARIOS = {
    "one previous paper": ("one", "predictor.name=previous", "fine_tuner.mode=paper"),
    "one measured paper on demand": (
        "one", "predictor.name=measured", "fine_tuner.mode=paper", "world.camera.mode=on_demand",
    ),
    "one measured precise": ("one", "predictor.name=measured"),
    "one formation precise, seed 7": ("one", "predictor.name=formation", "seed=7"),
    "two previous precise on demand": ("two", "predictor.name=previous", "world.camera.mode=on_demand"),
    "two literal paper": ("two", "predictor.name=literal", "fine_tuner.mode=paper"),
    "two measured paper": ("two", "predictor.name=measured", "fine_tuner.mode=paper", "seed=3"),
    "two edmd paper": ("two", "predictor.name=edmd", "fine_tuner.mode=paper"),
    "two formation precise": ("two", "predictor.name=formation"),
    "two kalman_trend+close paper": ("two", "predictor.name=kalman_trend+close", "fine_tuner.mode=paper"),
    "two tags": ("two", "predictor.name=formation", "marker=tags"),
    "one pid": ("one", "predictor.name=measured", "world.motor.drive_mode=pid"),
    "one two followers": ("one", "predictor.name=formation", "followers=2", "leader.timesteps=8"),
    "ripple": ("two", "predictor.name=formation", "world.surface=ripple", "world.surface_parameters=[]"),
    "saddle": ("two", "predictor.name=measured", "world.surface=saddle", "world.surface_parameters=[]"),
    "lost in the dark": ("one", "predictor.name=measured", "world.camera.illuminance_lux=1.0"),
    "lost on the way": (
        "one", "predictor.name=previous", "leader.step_m=0.2", "fine_tuner.max_v_m=0.001",
        "fine_tuner.alignment.max_moves=1", "fine_tuner.mode=paper", "leader.timesteps=5",
    ),
    "off the plate": (
        "two", "predictor.name=measured", "leader.step_m=0.1", "fine_tuner.first_step_m=0.1",
        "leader.timesteps=40", "world.camera.mode=on_demand",
    ),
}  # fmt: skip


def feed(digest: Any, value: Any) -> None:
    """Put a message's values into a digest, field by field: the padding of a serialised one holds chance bytes."""
    if hasattr(value, "get_fields_and_field_types"):
        for field in value.get_fields_and_field_types():
            feed(digest, getattr(value, field))
    elif isinstance(value, float):
        digest.update(struct.pack("<d", value))
    elif isinstance(value, list | tuple):
        for element in value:
            feed(digest, element)
    elif hasattr(value, "tobytes"):
        digest.update(value.tobytes())
    else:
        digest.update(f"{value!r};".encode())


def run(name: str) -> dict[str, Any]:
    """Run a scenario; return its outcome and, by topic, the number of messages and their digest."""
    track, *settings = SCENARIOS[name]
    scenario = scenarios.override(scenarios.load_track(track), settings)
    counts: dict[str, int] = {}
    digests: dict[str, Any] = {}

    def listen(topic: str, message: Any) -> None:
        if topic.rpartition("/")[2] in TOPICS:
            counts[topic] = counts.get(topic, 0) + 1
            feed(digests.setdefault(topic, hashlib.sha256()), message)

    code, _ = InProcessRun(scenario, listen=listen).run()
    topics = {topic: f"{counts[topic]} {digests[topic].hexdigest()[:DIGITS]}" for topic in sorted(counts)}
    return {"exit_code": code, "topics": topics}


def differences(name: str, before: dict[str, Any], now: dict[str, Any]) -> Iterator[str]:
    """Yield what differs, in words."""
    if before["exit_code"] != now["exit_code"]:
        yield f"{name}: exit code {before['exit_code']} before, {now['exit_code']} now"
    for topic in sorted({*before["topics"], *now["topics"]}):
        old, new = before["topics"].get(topic, "none"), now["topics"].get(topic, "none")
        if old != new:
            yield f"{name}: {topic}: {old} before, {new} now"


def main() -> int:
    """Compare or write; return 1 if something differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="keep today's digests instead of comparing with them")
    parser.add_argument("--only", metavar="TEXT", default="", help="scenarios with this text in their name")
    parser.add_argument("--jobs", metavar="N", type=int, default=2, help="processes (default 2)")
    args = parser.parse_args()
    chosen = [name for name in SCENARIOS if args.only in name]
    stored = json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else {}
    found: list[str] = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for name, result in zip(chosen, pool.map(run, chosen), strict=True):
            told = list(differences(name, stored.get(name, {"exit_code": None, "topics": {}}), result))
            ticks = next((text for topic, text in result["topics"].items() if topic.endswith("follower_1/done")), "0")
            verdict = "differs" if told else "equal"
            print(f"{name}: exit code {result['exit_code']}, {ticks.split()[0]} ticks: {verdict}")
            found += told
            stored[name] = result
    if args.write:
        STORE.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
        return 0
    print("\n".join(found) or f"all {len(chosen)} runs are equal")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
