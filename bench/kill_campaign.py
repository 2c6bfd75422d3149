"""Kills, stops and interrupts runs at random moments, and checks what they say and what they leave behind.

    python bench/kill_campaign.py --kills 40 --stops 20 --interrupts 20

Each case is a short run of its own through the node graph. SIGKILL and SIGSTOP hit one node of every kind in turn,
between the start of the nodes and the last timestep; the run has to name the node and end with exit code 4, with a bag
that can be read up to the last finished timestep. Interrupts hit the whole command, from its first millisecond to its
last; it has to end with 130 and without a traceback. Nothing may be left: no process, temporary folder or file in
shared memory. Prints a table in Markdown and every failure; the exit code is 1 if there was one.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import pty
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
TIMESTEPS = 4
NODES = (
    "/world",
    "/overhead_tracker",
    "/leader/leader",
    "/leader/drive",
    "/follower_1/drive",
    "/follower_1/block_detector",
    "/follower_1/predictor",
    "/follower_1/fine_tuner",
    "/recorder",
)
INTERRUPTS = ("SIGINT", "SIGINT twice", "SIGTERM", "SIGHUP", "closed terminal", "SIGINT in a sweep")
DEADLINE_S = 240.0
ATTEMPTS = 4  # with another moment, if the run was over before the signal came
_TOLD = re.compile(r"^timestep +(\d+)/", re.MULTILINE)
_SHARED = re.compile(r"/dev/shm/((?:sem\.)?fastrtps_(?:[0-9a-f]{16}|port\d+)\w*)")
_SHARED_BY_ALL = re.compile(r"port70\d\d")  # by every domain of the machine


@dataclass(frozen=True)
class Case:
    """What is done to a run: a signal to a node, or an interrupt of the command; and when, from 0 to 1."""

    kind: str
    node: str
    moment: float
    seed: int


@dataclass
class Outcome:
    """What came of a case: seconds from the signal to the end and until the node was named, timesteps told before it,
    and what was wrong.
    """

    case: Case
    seconds: float = 0.0
    named_s: float = 0.0
    timesteps: int = 0
    late: bool = False
    problems: list[str] = field(default_factory=list)
    output: str = ""


class Command:
    """A command in a session of its own, its output gathered as it comes."""

    def __init__(self, arguments: list[str], folder: Path, *, terminal: bool = False) -> None:
        self.began = time.monotonic()
        environment = {**os.environ, "TMPDIR": str(folder)}
        self._text: list[str] = []
        self.pids: set[int] = set()
        self.shared: set[str] = set()
        self.master: int | None = None
        if terminal:
            self.master, slave = pty.openpty()
            self.process = subprocess.Popen(
                arguments, env=environment, stdin=slave, stdout=slave, stderr=slave, preexec_fn=_own_terminal
            )
            os.close(slave)
            source = self.master
        else:
            self.process = subprocess.Popen(
                arguments,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            assert self.process.stdout is not None
            source = os.dup(self.process.stdout.fileno())
        self._reader = threading.Thread(target=self._read, args=(source, not terminal), daemon=True)
        self._reader.start()

    def _read(self, source: int, own: bool) -> None:
        with contextlib.suppress(OSError):
            while data := os.read(source, 65536):
                self._text.append(data.decode(errors="replace"))
        if own:
            os.close(source)

    @property
    def text(self) -> str:
        """Its output so far."""
        return "".join(self._text).replace("\r\n", "\n")

    @property
    def told(self) -> int:
        """The last timestep told."""
        return max(map(int, _TOLD.findall(self.text)), default=0)

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.process.poll() is not None

    def nodes(self) -> dict[str, int]:
        """Process ids of the nodes that run, by name; all that were ever seen are kept in `pids`."""
        found = {}
        for pid in descendants(self.process.pid):
            self.pids.add(pid)
            with contextlib.suppress(OSError):
                command = Path(f"/proc/{pid}/cmdline").read_bytes().decode().replace("\0", " ").split()
                kind = command[1] if command[:1] == ["robot_formation"] else None
                space = next((part for part in command if part.startswith("__ns:=")), "__ns:=/")
                if kind is not None:
                    found[f"{space.removeprefix('__ns:=').rstrip('/')}/{kind}"] = pid
        return found

    def note_shared_memory(self) -> None:
        """Keep the names of the files that its processes have mapped."""
        for pid in (self.process.pid, *self.pids):
            with contextlib.suppress(OSError):
                self.shared |= set(_SHARED.findall(Path(f"/proc/{pid}/maps").read_text()))

    def wait(self) -> int | None:
        """Wait for the end; None if it takes too long."""
        try:
            code = self.process.wait(DEADLINE_S)
        except subprocess.TimeoutExpired:
            return None
        self._reader.join(5.0)
        return code

    def end(self) -> None:
        """Let nothing of it live on."""
        for pid in {self.process.pid, *descendants(self.process.pid), *filter(alive, self.pids)}:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        if self.master is not None:
            os.close(self.master)


def _own_terminal() -> None:
    import fcntl
    import termios

    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def descendants(pid: int) -> Iterator[int]:
    """All processes below one."""
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            for child in map(int, task.read_text().split()):
                yield child
                yield from descendants(child)


def alive(pid: int) -> bool:
    """Whether a process runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def run_arguments(folder: Path, seed: int) -> list[str]:
    """A short run."""
    settings = [f"leader.timesteps={TIMESTEPS}", "predictor.name=previous"]
    options = [text for setting in settings for text in ("--set", setting)]
    command = [str(ROOT / "formation"), "run", "--track", "one", "--camera", "on_demand", "--seed", str(seed)]
    return [*command, *options, "--bag", str(folder / "bag")]


def sweep_arguments(folder: Path, seed: int) -> list[str]:
    """A short sweep."""
    command = [str(ROOT / "formation"), "sweep", "--tracks", "one", "--predictors", "previous", "--jobs", "2"]
    return [*command, "--seeds", f"{seed}:{seed + 4}", "--set", "leader.timesteps=3", "--out", str(folder / "sweep")]


@dataclass(frozen=True)
class Pace:
    """Seconds that an undisturbed command takes: from its nodes to the first timestep, for each other one, in all."""

    first_s: float
    timestep_s: float
    end_s: float


def measure(arguments: list[str], folder: Path) -> Pace:
    """Watch a command that nothing is done to.

    Raises:
        SystemExit: it fails.
    """
    command = Command(arguments, folder)
    nodes_s = first_s = last_s = 0.0
    while not command.over:
        now = time.monotonic() - command.began
        if not nodes_s and len(command.nodes()) == len(NODES):
            nodes_s = now
        if not first_s and command.told:
            first_s = now
        if not last_s and command.told == TIMESTEPS:
            last_s = now
        time.sleep(0.02)
    code = command.wait()
    command.end()
    if code != 0:
        raise SystemExit(f"an undisturbed command ends with {code}:\n{command.text}")
    each_s = (last_s - first_s) / (TIMESTEPS - 1)
    return Pace(first_s - nodes_s, each_s, time.monotonic() - command.began)


def hit_node(case: Case, pace: Pace, folder: Path) -> Outcome:
    """Send SIGKILL or SIGSTOP to a node of a run."""
    outcome = Outcome(case)
    command = Command(run_arguments(folder, case.seed), folder)
    try:
        while not command.over and case.node not in command.nodes():
            time.sleep(0.02)
        # Counted in timesteps, since a second of a busy machine is not that of the undisturbed run.
        after, part = divmod(case.moment * TIMESTEPS, 1.0)
        while not command.over and command.told < after:
            time.sleep(0.005)
        until = time.monotonic() + part * (pace.timestep_s if after else pace.first_s)
        while not command.over and time.monotonic() < until and command.told <= after:
            time.sleep(0.005)
        pid = command.nodes().get(case.node)
        command.note_shared_memory()
        outcome.timesteps = command.told
        if pid is None or outcome.timesteps == TIMESTEPS:
            outcome.late = True
            return outcome
        number = signal.SIGKILL if case.kind == "SIGKILL" else signal.SIGSTOP
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)
        hit = time.monotonic()
        while not command.over and f"node {case.node} " not in command.text and time.monotonic() - hit < DEADLINE_S:
            time.sleep(0.05)
        outcome.named_s = time.monotonic() - hit
        code = command.wait()
        outcome.seconds = time.monotonic() - hit
        outcome.output = command.text
        check_death(outcome, code, folder)
        check_leftovers(outcome, command, folder)
    finally:
        command.end()
    return outcome


def check_death(outcome: Outcome, code: int | None, folder: Path) -> None:
    """The run names the node and ends with 4, and its bag holds every timestep that was finished."""
    case, problems = outcome.case, outcome.problems
    if code == 0 and len(timesteps_in(folder / "bag", []) or ()) == TIMESTEPS:
        outcome.late = True  # its work was done, and the run with it
        return
    if code != 4:
        problems.append("did not end" if code is None else f"exit code {code}")
    last = next((line for line in outcome.output.splitlines() if line.startswith("formation run:")), "")
    if f"node {case.node} " not in last:
        problems.append(f"the node is not named: '{last}'")
    if "Traceback" in outcome.output:
        problems.append("a traceback")
    # The recorder may be gone between the line of a timestep and its tick, which ends it.
    expected = outcome.timesteps - (case.node == "/recorder")
    if not (folder / "bag").exists():
        if expected > 0:
            problems.append("no bag")
        return
    if json_of("info", folder / "bag") is None:
        problems.append("info can't read the bag")
    if expected > 0:
        found = timesteps_in(folder / "bag", problems)
        if found is not None and len(found) < expected:
            problems.append(f"the bag has {len(found)} of {expected} timesteps")


def timesteps_in(bag: Path, problems: list[str]) -> list[object] | None:
    """The timesteps that the analysis finds in a bag."""
    analysis = json_of("analyze", bag)
    if analysis is None:
        problems.append("analyze can't read the bag")
        return None
    timesteps: list[object] = analysis["timesteps"]
    return timesteps


def json_of(verb: str, bag: Path) -> dict[str, Any] | None:
    """What a verb says of a bag."""
    command = [str(ROOT / "formation"), verb, str(bag), "--json"]
    completed = subprocess.run(command, capture_output=True, text=True, check=False)
    return json.loads(completed.stdout) if completed.returncode == 0 else None


def interrupt(case: Case, pace: Pace, folder: Path) -> Outcome:
    """Interrupt a run or a sweep."""
    outcome = Outcome(case)
    sweep = case.kind == "SIGINT in a sweep"
    arguments = (sweep_arguments if sweep else run_arguments)(folder, case.seed)
    command = Command(arguments, folder, terminal=case.kind == "closed terminal")
    try:
        until = command.began + case.moment * pace.end_s
        while not command.over and time.monotonic() < until:
            command.nodes()
            command.note_shared_memory()
            time.sleep(min(0.05, max(0.0, until - time.monotonic())))
        command.nodes()
        outcome.timesteps = command.told
        if command.over:
            outcome.late = True
            return outcome
        hit = time.monotonic()
        _send(case, command)
        code = command.wait()
        outcome.seconds = time.monotonic() - hit
        outcome.output = command.text
        number = {"SIGTERM": signal.SIGTERM, "SIGHUP": signal.SIGHUP, "closed terminal": signal.SIGHUP}.get(
            case.kind, signal.SIGINT
        )
        # Before the shell script has handed over to Python the signal itself ends it, as quietly.
        if code not in (130, -number):
            whole = "bag:" in outcome.output or "summary:" in outcome.output or case.kind == "closed terminal"
            if code == 0 and whole:
                outcome.late = True  # only Python's own end was left
            else:
                outcome.problems.append("did not end" if code is None else f"exit code {code}")
        if re.search(r"Traceback|Error\b|Exception", outcome.output):
            outcome.problems.append("a traceback")
        check_leftovers(outcome, command, folder)
    finally:
        command.end()
    return outcome


def _send(case: Case, command: Command) -> None:
    # A terminal's Ctrl-C reaches every process of its foreground group.
    with contextlib.suppress(ProcessLookupError):
        if case.kind == "closed terminal":
            assert command.master is not None
            os.close(command.master)
            command.master = None
        elif case.kind in ("SIGTERM", "SIGHUP"):
            os.kill(command.process.pid, getattr(signal, case.kind))
        else:
            os.killpg(command.process.pid, signal.SIGINT)
        if case.kind == "SIGINT twice":
            time.sleep(random.Random(case.seed).uniform(0.0, 1.0))
            os.killpg(command.process.pid, signal.SIGINT)


def check_leftovers(outcome: Outcome, command: Command, folder: Path) -> None:
    """Nothing is left but the bag."""
    end = time.monotonic() + 10.0
    while any(map(alive, command.pids)) and time.monotonic() < end:
        time.sleep(0.1)  # loky's resource tracker ends a moment after the sweep
    if living := [pid for pid in command.pids if alive(pid)]:
        outcome.problems.append(f"processes left: {living}")
    if folders := [path.name for path in folder.glob("robot_formation_*")]:
        outcome.problems.append(f"temporary folders left: {folders}")
    left = [name for name in command.shared if Path("/dev/shm", name).exists() and not _SHARED_BY_ALL.search(name)]
    if left:
        outcome.problems.append(f"shared memory left: {left}")


def carry_out(case: Case, paces: dict[str, Pace]) -> Outcome:
    """Do a case, at another moment if it came too late."""
    for attempt in range(ATTEMPTS):
        moment = case.moment * 0.7**attempt
        with tempfile.TemporaryDirectory(prefix="kill_campaign_") as name:
            again = Case(case.kind, case.node, moment, case.seed)
            if case.node:
                outcome = hit_node(again, paces["run"], Path(name))
            else:
                outcome = interrupt(again, paces["sweep" if "sweep" in case.kind else "run"], Path(name))
        if outcome.problems or not outcome.late:
            break
    state = "; ".join(outcome.problems) or ("too late" if outcome.late else "ok")
    what = " ".join(filter(None, (case.kind, case.node)))
    print(
        f"{what:<36} at {moment:.2f}, timestep {outcome.timesteps}, {outcome.seconds:5.1f} s: {state}", file=sys.stderr
    )
    return outcome


def plan(args: argparse.Namespace) -> list[Case]:
    """All cases, every kind of node in turn."""
    chance = random.Random(args.seed)
    cases = []
    for kind, count in (("SIGKILL", args.kills), ("SIGSTOP", args.stops)):
        cases += [Case(kind, NODES[i % len(NODES)], chance.random(), chance.randrange(10**6)) for i in range(count)]
    for kind in INTERRUPTS:
        cases += [Case(kind, "", chance.random(), chance.randrange(10**6)) for _ in range(args.interrupts)]
    return cases


def table(outcomes: list[Outcome]) -> str:
    """A row for every kind of case."""
    lines = [
        "| what | cases | failures | too late | longest s until named | median s to the end | longest |",
        "|---|---|---|---|---|---|---|",
    ]
    kinds = dict.fromkeys(outcome.case.kind for outcome in outcomes)
    for kind in kinds:
        group = [outcome for outcome in outcomes if outcome.case.kind == kind]
        failures = sum(bool(outcome.problems) for outcome in group)
        late = sum(outcome.late for outcome in group)
        seconds = [outcome.seconds for outcome in group if not outcome.late] or [0.0]
        named = max((outcome.named_s for outcome in group if not outcome.late), default=0.0)
        times = f"{named:.1f} | {statistics.median(seconds):.1f} | {max(seconds):.1f}"
        lines.append(f"| {kind} | {len(group)} | {failures} | {late} | {times} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=40, help="SIGKILLs of nodes")
    parser.add_argument("--stops", type=int, default=20, help="SIGSTOPs of nodes")
    parser.add_argument("--interrupts", type=int, default=20, help="interrupts of each kind")
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    parser.add_argument("--jobs", type=int, default=1, help="cases at the same time")
    args = parser.parse_args()
    cases = plan(args)
    paces = {}
    with tempfile.TemporaryDirectory(prefix="kill_campaign_") as name:
        paces["run"] = measure(run_arguments(Path(name), 0), Path(name))
    if args.interrupts:
        with tempfile.TemporaryDirectory(prefix="kill_campaign_") as name:
            paces["sweep"] = measure(sweep_arguments(Path(name), 0), Path(name))
    with ThreadPoolExecutor(args.jobs) as pool:
        outcomes = list(pool.map(lambda case: carry_out(case, paces), cases))
    print(table(outcomes))
    failed = [outcome for outcome in outcomes if outcome.problems]
    for outcome in failed:
        print(f"\n{outcome.case}\n  {'; '.join(outcome.problems)}")
        print("\n".join(f"  | {line}" for line in outcome.output.splitlines()[-30:]))
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
