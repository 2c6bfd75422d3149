"""What a view costs: runs with a viewer against runs without one, in turns; and how long a long bag takes to open.

Over the graph, track two, as fast as possible and at real time; nobody looks unless a Chromium is installed and asked
for (--chromium). Prints seconds and ratios, and ends with 1 if an aim is missed: at most 1.3 times as long at full
speed, at most 2 % longer than real time where the run without a viewer keeps up, and a thousand timesteps shown within
3 s, from the start of the command to the scene that a browser gets.

Run: python bench/viewing.py [--rounds 3] [--bag FOLDER] [--timesteps 1000] [--skip-runs] [--chromium] [--json]
"""

import argparse
import contextlib
import json
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from comparison import Comparison, add_comparisons, as_json
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import run_in_process
from robot_formation.launching.launcher import Launcher
from robot_formation.launching.processes import run_metadata
from robot_formation.viewing.browser import address, check_viewer

AIMS = {"full speed": 1.3, "real time": 1.02, "opening [s]": 3.0}
SETTINGS = ("leader.step_m=0.002", "world.camera.mode=on_demand")


@contextlib.contextmanager
def looking(port: int, *, wanted: bool) -> Iterator[None]:
    """Let a headless Chromium open the page as soon as it is there."""
    if not wanted:
        yield
        return
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        raise SystemExit("--chromium: no Chromium is installed")
    options = ["--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        command = [program, *options, f"--user-data-dir={folder}", "--remote-debugging-port=0", address(port)]
        timer_of: list[subprocess.Popen[bytes]] = []
        quiet = subprocess.DEVNULL
        timer = threading.Timer(6.0, lambda: timer_of.append(subprocess.Popen(command, stdout=quiet, stderr=quiet)))
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
            for browser in timer_of:
                browser.kill()
                browser.wait()


def run_s(factor: float, *, view: bool, chromium: bool) -> float:
    """Return the seconds of a run after its start, without the time that its nodes take to start and end."""
    scenario = scenarios.override(scenarios.load_track("two"), ["seed=3", f"world.real_time_factor={factor}"])
    port = check_viewer(0)
    with tempfile.TemporaryDirectory() as folder, looking(port, wanted=view and chromium):
        result = Launcher(scenario, Path(folder) / "bag", view_port=port if view else None).run()
    if result.exit_code != 0:
        raise SystemExit(f"the run ended with {result.exit_code}: {result.reason}")
    return result.running_s


def opening_s(bag: Path) -> float:
    """Return the seconds from the start of `formation view` until its page can be opened, scene and all."""
    command = [sys.executable, "-m", "robot_formation.cli", "view", str(bag), "--port", "0"]
    began = time.perf_counter()
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    try:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("view: "):  # said once the scene has been built
                return time.perf_counter() - began
        raise SystemExit(f"'{' '.join(command)}' ended with {process.wait()}")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def long_bag(folder: Path, timesteps: int) -> Path:
    scenario = scenarios.override(scenarios.load_track("one"), [*SETTINGS, f"leader.timesteps={timesteps}"])
    result = run_in_process(scenario, folder / "long", run_metadata(scenario))
    if result.exit_code != 0:
        raise SystemExit(f"the run of {timesteps} timesteps ended with {result.exit_code}: {result.reason}")
    return folder / "long"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3, help="runs of each kind, and openings")
    parser.add_argument("--bag", type=Path, help="a long run's bag; else one is made, which takes minutes")
    parser.add_argument("--timesteps", type=int, default=1000, help="of the bag that is made")
    parser.add_argument("--skip-runs", action="store_true", help="only open the bag")
    parser.add_argument("--chromium", action="store_true", help="let a headless Chromium look at the runs")
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_comparisons(parser)
    args = parser.parse_args()
    found: dict[str, dict[str, float]] = {}
    for name, factor in () if args.skip_runs else (("full speed", 0.0), ("real time", 1.0)):
        taken: dict[bool, list[float]] = {False: [], True: []}
        for _ in range(args.rounds):
            for view in (False, True):
                taken[view].append(run_s(factor, view=view, chromium=args.chromium))
        without, with_view = (statistics.median(taken[view]) for view in (False, True))
        found[name] = {"without [s]": without, "with --view [s]": with_view, "result": with_view / without}
    with tempfile.TemporaryDirectory() as folder:
        bag = args.bag or long_bag(Path(folder), args.timesteps)
        seconds = [opening_s(bag) for _ in range(args.rounds)]
        found["opening [s]"] = {"result": statistics.median(seconds), "slowest": max(seconds)}
    if args.comparisons:
        units = {name: "s" if name.endswith("[s]") else "times as long" for name in found}
        print(as_json(Comparison(f"view, {name}", v["result"], AIMS[name], units[name]) for name, v in found.items()))
        return 0
    if args.json:
        print(json.dumps(found))
    else:
        for name, values in found.items():
            figures = ", ".join(f"{key} {value:.2f}" for key, value in values.items())
            print(f"{name}: {figures} (aim: at most {AIMS[name]:g})")
    return int(any(values["result"] > AIMS[name] for name, values in found.items()))


if __name__ == "__main__":
    sys.exit(main())
