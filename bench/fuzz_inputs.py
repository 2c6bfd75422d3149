"""Damaged, random and hostile input of every kind to the command line: files, bags, settings and arguments.

Each case must end with 0 or 3, or with 2 and one short line on standard error. Failures are tracebacks, other exit
codes, long or several lines, JSON that is none, more than --cpu-s seconds of processor time (or --wall-s of any), and
more than --memory-mb of resident memory. A case depends on the seed and its number only. Failing inputs are kept.

Cases run in warm processes that are replaced now and then. Verbs that start the node graph are left out; scenarios are
loaded and checked, and arguments of these verbs are parsed.

Run: python bench/fuzz_inputs.py [--cases 10000] [--seed 0] [--jobs 2] [--keep DIR]; one case again: --only NUMBER.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import io
import json
import multiprocessing
import os
import re
import resource
import shutil
import sys
import tempfile
import time
import traceback
from argparse import Namespace
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from fuzz_cases import KINDS, Case, make_case

LONGEST_LINE = 900  # a message of 500 characters with the verb's name, and the paths of this place
ADDRESS_SPACE_BYTES = 6 << 30
CASES_PER_PROCESS = 400
HANG_NAME = "stacks.txt"


def perform(case: Case) -> int:
    """Call the verb, or what stands for one that would start nodes."""
    verb, *words = case.arguments
    if verb == "scenario":
        return use_scenario(words)
    if verb == "sweep-table":
        return use_sweep_table(words)
    if verb == "parse":
        from robot_formation.cli.main import make_parser

        make_parser().parse_args(words)
        return 0
    from robot_formation.cli.main import main

    return main(case.arguments)


def use_scenario(words: Sequence[str]) -> int:
    """Load a scenario, set values, check it, and collect the parameters of all its nodes, as `run` does."""
    from robot_formation.errors import FormationError
    from robot_formation.experiment import scenario as scenarios

    try:
        path, *settings = words
        found = scenarios.load(Path(path)) if path else scenarios.load_track("one")
        found = scenarios.override(found, settings)
        found.check()
        for kind, robot in found.hosts():
            found.of_robot(kind, robot)
        json.dumps(found.by_node(), allow_nan=False)
    except FormationError as error:
        print(f"formation scenario: {error}", file=sys.stderr)
        return 2
    return 0


def use_sweep_table(words: Sequence[str]) -> int:
    """Open a sweep's folder as `sweep` does before it runs anything."""
    from robot_formation.errors import FormationError
    from robot_formation.experiment.sweep import Plan, Table

    try:
        Table(Path(words[0]), Plan(("one",), ("bowl",), ("previous",), (0,)))
    except FormationError as error:
        print(f"formation sweep: {error}", file=sys.stderr)
        return 2
    except OSError as error:  # as `main` tells it
        print(f"formation sweep: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    return 0


def judged(case: Case, code: int, out: str, err: str) -> str:
    """Return what is wrong with how a case ended, or nothing."""
    if code not in (0, 2, 3):
        return f"exit code {code}"
    if "Traceback" in err:
        return "a traceback is printed"
    lines = [line for line in err.splitlines() if line.strip()]
    if any(len(line) > LONGEST_LINE for line in lines if not argparse_said(line)):
        return f"a line of {max(map(len, lines))} characters"
    if code == 2 and not (lines and ("formation" in lines[-1] or "error:" in lines[-1])):
        return f"exit code 2 without a reason: {lines[-1:]}"
    if code == 0 and "--json" in case.arguments:
        try:
            json.loads(out, parse_constant=lambda text: 1 / 0)
        except (ValueError, ZeroDivisionError):
            return "standard output is no strict JSON"
    return ""


def argparse_said(line: str) -> bool:
    """Tell lines that argparse prints, which repeats arguments in full."""
    return line.startswith(("usage:", " ")) or ": error: " in line


def run_case(seed: int, number: int, folder: Path) -> dict[str, Any]:
    """Run one case in this process; return what is known of it."""
    case = make_case(np.random.default_rng([seed, number]), number, folder)
    out, err = io.StringIO(), io.StringIO()
    reset_peak()
    wall_s, cpu_s = time.monotonic(), time.process_time()
    wrong = ""
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = perform(case)
    except SystemExit as leave:
        code = leave.code if isinstance(leave.code, int) else 2
    except BaseException:
        code, wrong = -1, traceback.format_exc()
    result = {
        "number": number,
        "kind": case.kind,
        "arguments": case.arguments,
        "code": code,
        "wall_s": time.monotonic() - wall_s,
        "cpu_s": time.process_time() - cpu_s,
        "peak_mb": peak_mb(),
    }
    result["wrong"] = wrong or judged(case, code, out.getvalue(), err.getvalue())
    result["said"] = err.getvalue()[-2000:]
    return result


def reset_peak() -> None:
    """Set the kernel's record of this process's largest resident set back."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_mb() -> float:
    """Largest resident set since then, megabytes."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(found[1]) / 1024 if found else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def work(pipe: Connection, seed: int, folder: Path, wall_s: float) -> None:
    """Serve case numbers until None comes."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_BYTES, ADDRESS_SPACE_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ["MPLBACKEND"] = "Agg"
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):  # libraries in C print past Python
        os.dup2(nowhere, number)
    tempfile.tempdir = str(folder / "tmp")
    for number in iter(pipe.recv, None):
        place = folder / f"case_{number}"
        place.mkdir(parents=True)
        os.chdir(place)
        with (folder / HANG_NAME).open("w") as stacks:
            faulthandler.dump_traceback_later(0.9 * wall_s, file=stacks)
            result = run_case(seed, number, place)
            faulthandler.cancel_dump_traceback_later()
        pipe.send(result)


class Worker:
    """A process that runs cases, one at a time."""

    def __init__(self, context: SpawnContext, options: Namespace, folder: Path) -> None:
        self.context, self.options, self.folder = context, options, folder
        self.number = 0
        self.start()

    def start(self) -> None:
        """Begin a new process."""
        self.done = 0
        self.pipe, theirs = self.context.Pipe()
        (self.folder / "tmp").mkdir(parents=True, exist_ok=True)
        arguments = (theirs, self.options.seed, self.folder, self.options.wall_s)
        self.process = self.context.Process(target=work, args=arguments, daemon=True)
        self.process.start()
        theirs.close()

    def give(self, number: int) -> None:
        """Hand a case out."""
        if self.done >= CASES_PER_PROCESS:
            self.end()
            self.start()
        self.number, self.since = number, time.monotonic()
        self.pipe.send(number)

    def result(self) -> dict[str, Any] | None:
        """Return how the case ended, None while it runs."""
        try:
            if self.pipe.poll():
                self.done += 1
                result: dict[str, Any] = self.pipe.recv()
                return result
        except (EOFError, OSError):
            return self.broken(f"the process died with {self.process.exitcode}")
        if time.monotonic() - self.since > self.options.wall_s:
            return self.broken(f"no end after {self.options.wall_s:g} s")
        return None

    def broken(self, why: str) -> dict[str, Any]:
        """Replace the process; return the case as failed."""
        self.process.kill()
        self.process.join()
        self.start()
        # Made again for its kind and arguments; its files are there already.
        with tempfile.TemporaryDirectory() as place:
            case = make_case(np.random.default_rng([self.options.seed, self.number]), self.number, Path(place))
        elapsed = time.monotonic() - self.since
        with contextlib.suppress(OSError):
            why += "\n" + (self.folder / HANG_NAME).read_text()
        found = {"number": self.number, "kind": case.kind, "arguments": case.arguments, "code": None, "said": ""}
        return {**found, "wall_s": elapsed, "cpu_s": elapsed, "peak_mb": 0.0, "wrong": why}

    def end(self) -> None:
        """End the process."""
        with contextlib.suppress(OSError):
            self.pipe.send(None)
        self.process.join(5)
        self.process.kill()


def run_all(
    options: Namespace, numbers: Sequence[int], tell: Callable[[dict[str, Any]], None] = lambda result: None
) -> list[dict[str, Any]]:
    """Run the cases; return the results in the order of their ends."""
    context = multiprocessing.get_context("spawn")
    results = []
    with tempfile.TemporaryDirectory(prefix="fuzz_inputs_") as scratch:
        waiting = list(numbers)[::-1]
        jobs = min(options.jobs, len(waiting))
        workers = [Worker(context, options, Path(scratch, f"worker_{n}")) for n in range(jobs)]
        busy = []
        for worker in workers:
            worker.give(waiting.pop())
            busy.append(worker)
        while busy:
            for worker in list(busy):
                result = worker.result()
                if result is None:
                    continue
                finish(result, worker, options)
                results.append(result)
                tell(result)
                if waiting:
                    worker.give(waiting.pop())
                else:
                    busy.remove(worker)
            time.sleep(0.002)
        for worker in workers:
            worker.end()
    return results


def finish(result: dict[str, Any], worker: Worker, options: Namespace) -> None:
    """Judge time and memory, keep the files of a failure, remove the others."""
    if not result["wrong"] and result["cpu_s"] > options.cpu_s:
        result["wrong"] = f"{result['cpu_s']:.1f} s of processor time"
    if not result["wrong"] and result["peak_mb"] > options.memory_mb:
        result["wrong"] = f"{result['peak_mb']:.0f} MB"
    place = worker.folder / f"case_{result['number']}"
    if result["wrong"] and options.keep:
        target = Path(options.keep, f"case_{result['number']}")
        shutil.rmtree(target, ignore_errors=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(OSError, shutil.Error):
            shutil.copytree(place, target, symlinks=True, ignore=not_a_file)
    shutil.rmtree(place, ignore_errors=True)


def not_a_file(folder: str, names: Sequence[str]) -> list[str]:
    """Name what can't be copied: named pipes and links to devices."""
    return [name for name in names if not Path(folder, name).is_file() and not Path(folder, name).is_dir()]


def table(results: Sequence[dict[str, Any]]) -> str:
    """Write the results as a table, a line per kind."""
    lines = [
        "| kind | cases | done | refused | failures | slowest (s) | largest (MB) |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in [*KINDS, "all"]:
        chosen = [result for result in results if kind in (result["kind"], "all")]
        if not chosen:
            continue
        done, refused = (sum(r["code"] in codes and not r["wrong"] for r in chosen) for codes in ((0, 3), (2,)))
        failed = sum(bool(result["wrong"]) for result in chosen)
        slowest = max(result["cpu_s"] for result in chosen)
        largest = max(result["peak_mb"] for result in chosen)
        lines.append(f"| {kind} | {len(chosen)} | {done} | {refused} | {failed} | {slowest:.1f} | {largest:.0f} |")
    return "\n".join(lines)


def report(result: dict[str, Any], seed: int) -> str:
    """Write a failure with the command that repeats it."""
    number, words = result["number"], " ".join(map(repr, result["arguments"]))
    return (
        f"case {number} ({result['kind']}): {result['wrong'].strip()}\n  arguments: {words[:1000]}\n"
        f"  said: {result['said'].strip()[-500:]}\n  again: python bench/fuzz_inputs.py --seed {seed} --only {number}"
    )


def parsed(arguments: Sequence[str] | None = None) -> Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", type=int, action="append", help="run this case only; may be repeated")
    parser.add_argument("--cpu-s", type=float, default=10.0)
    parser.add_argument("--wall-s", type=float, default=60.0)
    parser.add_argument("--memory-mb", type=float, default=1024.0)
    parser.add_argument("--keep", default="fuzz_failures", help="folder for the files of failures")
    return parser.parse_args(arguments)


def main() -> int:
    """Run the cases and print the table and the failures; return 1 if there are any."""
    options = parsed()
    numbers = options.only or range(options.first, options.first + options.cases)
    started = time.monotonic()
    count = 0

    def tell(result: dict[str, Any]) -> None:
        nonlocal count
        count += 1
        if result["wrong"]:
            print(report(result, options.seed), flush=True)
        if count % 250 == 0:
            print(f"{count}/{len(numbers)} cases, {time.monotonic() - started:.0f} s", file=sys.stderr, flush=True)

    results = run_all(options, numbers, tell)
    print(table(results))
    return int(any(result["wrong"] for result in results))


if __name__ == "__main__":
    raise SystemExit(main())
