"""The command line's process: interrupts are quiet whenever they come, and closed streams don't change a run."""

import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from graph_tools import alive
from repository import ROOT

pytestmark = pytest.mark.slow

PROCESS = [sys.executable, "-m", "robot_formation.cli"]
QUICK_RUN = ["run", "--track", "one", "--in-process", "--camera", "on_demand", "--set", "leader.timesteps=1", "--json"]
LONG_RUN = [*QUICK_RUN[:-2], "leader.timesteps=500", "--set", "leader.step_m=0.001"]
# Sends its own process a signal at a certain point: nothing has to be timed.
HOOK = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            for _ in range({times}):
                os.kill(os.getpid(), signal.{number})
sys.meta_path.insert(0, Finder())
"""


def interrupted_at(
    tmp_path: Path, module: str, *arguments: str, number: str = "SIGINT", times: int = 1, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a verb that gets a signal when it begins to import a module."""
    (tmp_path / "sitecustomize.py").write_text(HOOK.format(module=module, times=times, number=number))
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    command = [*PROCESS, *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False, **options)


@pytest.mark.parametrize(("number", "times"), [("SIGINT", 1), ("SIGINT", 2), ("SIGTERM", 1), ("SIGHUP", 1)])
@pytest.mark.parametrize("module", ["argparse", "robot_formation.cli.sweep", "numpy", "numpy.linalg", "pybullet"])
def test_an_interrupt_while_importing_is_one_line(tmp_path: Path, module: str, number: str, times: int) -> None:
    completed = interrupted_at(tmp_path, module, *QUICK_RUN, number=number, times=times)
    assert completed.returncode == 130
    assert completed.stdout == ""
    assert completed.stderr.splitlines()[-1].endswith("interrupted")
    assert "Traceback" not in completed.stderr


def test_under_nohup_a_closed_terminal_ends_nothing(tmp_path: Path) -> None:
    def ignore() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    arguments = [*QUICK_RUN, "--bag", str(tmp_path / "bag")]
    completed = interrupted_at(tmp_path, "numpy", *arguments, number="SIGHUP", preexec_fn=ignore)
    assert completed.returncode == 0
    assert "interrupted" not in completed.stderr


def test_the_script_keeps_interrupts_until_they_can_be_taken(tmp_path: Path) -> None:
    stamp = Path(os.environ.get("FORMATION_VENV", ROOT / ".venv"), "formation-installed")
    if not stamp.is_file() or stamp.read_text().splitlines()[0] != str(ROOT.resolve()):
        pytest.skip("./formation has installed nothing here, and would do so now")
    script = ROOT / "formation"
    with subprocess.Popen([script, "doctor"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while b"python" not in _command_of(process.pid) and process.poll() is None:
            pass
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) in ((130, "formation: interrupted\n"), (130, "formation doctor: interrupted\n"))


def _command_of(pid: int) -> bytes:
    with open(f"/proc/{pid}/cmdline", "rb") as file:
        return file.read().split(b"\0")[0]


def test_an_interrupt_in_a_destructor_is_not_lost() -> None:
    code = """
import signal, sys
from robot_formation.cli.interrupts import Interrupts
Interrupts().install()
class Last:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
try:
    thing = Last()
    del thing
    signal.pause()
    sys.exit(1)
except KeyboardInterrupt:
    sys.exit(0)
"""
    completed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (completed.returncode, completed.stderr) == (0, "")


def test_an_interrupt_in_a_destructor_does_not_kill_a_process_that_ends() -> None:
    code = """
import signal
from robot_formation.cli import interrupts
interrupts._AGAIN_S = 1000.0
process = interrupts.Interrupts()
process.install()
class Last:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
thing = Last()
del thing
assert signal.getitimer(signal.ITIMER_REAL)[0] > 0.0
process.leave(0)
assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
signal.raise_signal(signal.SIGALRM)  # one that was under way
"""
    completed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (completed.returncode, completed.stdout, completed.stderr) == (0, "", "")


@pytest.mark.parametrize("closed", ["1", *(pytest.param(n, marks=pytest.mark.long) for n in ("2", "12")), "012"])
def test_closed_streams_leave_the_exit_code_and_the_bag_alone(tmp_path: Path, closed: str) -> None:
    bag = tmp_path / "bag"
    closing = " ".join(f"{number}>&-" for number in closed)
    command = ["sh", "-c", f'exec "$@" {closing}', "sh", *PROCESS, *QUICK_RUN, "--bag", str(bag)]
    completed = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert completed.returncode == 0
    assert "Traceback" not in completed.stderr
    info = subprocess.run([*PROCESS, "info", str(bag), "--json"], capture_output=True, text=True, check=False)
    assert info.returncode == 0


def test_a_closed_pipe_does_not_change_the_exit_code_of_a_run(tmp_path: Path) -> None:
    command = [*PROCESS, *QUICK_RUN, "--set", "world.camera.pan_deg=-90.0", "--bag", str(tmp_path / "bag")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        errors = process.stderr.read()
    assert process.returncode == 3
    assert "Traceback" not in errors


@pytest.mark.parametrize("arguments", [["list"], ["list", "--json"], ["--help"], ["list", "--help"], ["--version"]])
def test_a_full_disk_is_one_line_and_exit_code_2(arguments: list[str]) -> None:
    with open("/dev/full", "w") as full:
        completed = subprocess.run([*PROCESS, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert completed.returncode == 2
    assert completed.stderr.endswith(": output: No space left on device\n")
    assert len(completed.stderr.splitlines()) == 1


def test_a_terminal_that_is_closed_ends_a_run_by_130(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, [*PROCESS, *LONG_RUN, "--bag", str(bag)])
    text = b""
    while b"timestep  1/" not in text:
        text += os.read(terminal, 4096)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 130
    assert (bag / "metadata.yaml").is_file()


def test_an_interrupted_sweep_says_so_in_one_line_and_leaves_no_worker(tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = [*PROCESS, "sweep", "--tracks", "one", "--predictors", "previous", "--seeds", "0:40", "--jobs", "2"]
    command += ["--set", "leader.timesteps=1", "--out", str(out)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        while process.poll() is None and not (
            (out / "runs.csv").exists() and len((out / "runs.csv").read_text().splitlines()) > 2
        ):
            time.sleep(0.02)
        workers = [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        printed, errors = process.communicate(timeout=120)
    assert (process.returncode, printed) == (130, "")
    *progress, last = errors.strip().splitlines()
    assert last == f"formation sweep: interrupted; the same command with --out {out} goes on"
    seeds, *runs = [line for line in progress if line]
    assert seeds == "seeds 0 to 39 (40 seeds)"
    assert all("per minute" in line for line in runs)
    assert workers
    end = time.monotonic() + 60.0
    while any(map(alive, workers)):
        assert time.monotonic() < end, "a worker lives on"
        time.sleep(0.05)
