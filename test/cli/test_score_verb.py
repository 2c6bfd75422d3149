"""`formation score` as a person types it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from graph_tools import alive
from robot_formation.experiment import score

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("score_verb")]

LAST = """
class Last:
    def observe(self, displacement):
        self.last = displacement.copy()
    def forecast(self):
        return self.last
"""
PROCESS = [sys.executable, "-m", "robot_formation.cli", "score"]


def call(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([*PROCESS, *arguments], cwd=folder, capture_output=True, text=True, timeout=500, check=False)


@pytest.fixture(scope="module")
def scored(tmp_path_factory: pytest.TempPathFactory) -> "subprocess.CompletedProcess[str]":
    folder = tmp_path_factory.mktemp("scored")
    (folder / "mine.py").write_text(LAST)
    return call(folder, "mine:Last", "--quick", "--json", "--jobs", "2")


@pytest.mark.long
def test_a_class_of_ones_own_stands_beside_those_that_came_before(scored: Any) -> None:
    assert scored.returncode == 0, scored.stderr
    found = json.loads(scored.stdout)
    standings = {entry["predictor"]: entry for entry in found["standings"]}
    assert set(standings) == {"previous", "measured", "formation", "mine:Last"}
    assert [entry["rank"] for entry in found["standings"]] == sorted(entry["rank"] for entry in found["standings"])
    assert {entry["runs"] for entry in standings.values()} == {5}
    # It is what 'previous' is, but for the first timestep: nearly the same corrections.
    assert abs(standings["mine:Last"]["score"]) < 5.0
    assert standings["previous"]["score"] == 0.0
    assert standings["formation"]["score"] > 80.0
    assert found["conditions"]["mode"] == "paper"


@pytest.mark.long
def test_progress_goes_to_standard_error_and_the_seeds_are_told_nowhere(scored: Any) -> None:
    assert scored.stderr.splitlines()[0] == "4 predictors, 20 runs"
    assert "20/20 runs" in scored.stderr
    assert not [seed for seed in score._SEEDS if str(seed) in scored.stdout + scored.stderr]


BROKEN = {
    "no module 'mine'": None,
    "no 'Last'": "x = 1",
    "no method 'forecast'": "class Last:\n    def observe(self, x): pass",
    "ZeroDivisionError": "class Last:\n    def observe(self, x): 1 / 0\n    def forecast(self): return [0, 0]",
    "two or three finite numbers": LAST.replace("self.last\n", "[float('nan')] * 2\n"),
    "the next forecast depends on the horizon": "import random\n"
    + LAST.replace("self.last\n", "self.last * random.random()\n"),
}


@pytest.mark.parametrize("words", BROKEN)
def test_a_class_that_is_broken_is_one_line_before_anything_is_run(tmp_path: Path, words: str) -> None:
    code = BROKEN[words]
    if code is not None:
        (tmp_path / "mine.py").write_text(code)
    completed = call(tmp_path, "mine:Last")
    assert (completed.returncode, completed.stdout) == (2, "")
    (line,) = completed.stderr.splitlines()
    assert line.startswith("formation score: predictor 'mine:Last': ")
    assert words in line


def test_a_class_that_fails_late_is_one_line_without_the_seed(tmp_path: Path) -> None:
    fails = "\n        if len(self.all) > 15 and displacement[0] != 0.05 and FAIL: raise ValueError('too many')"
    code = LAST.replace("self.last = d", f"self.all = [*getattr(self, 'all', ()), 1]{fails}\n        self.last = d")
    # The checks pass in the first process; the workers are others.
    (tmp_path / "mine.py").write_text(f"import os, sys\nFAIL = 'loky' in ' '.join(sys.argv + sys.orig_argv)\n{code}")
    completed = call(tmp_path, "mine:Last", "--quick", "--jobs", "2")
    assert (completed.returncode, completed.stdout) == (2, "")
    last = completed.stderr.splitlines()[-1]
    assert last == "formation score: predictor 'mine:Last': observe failed: ValueError: too many"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["formaton"], "'formation'"), (["formation", "--jobs", "0"], "--jobs"), ([], "MODULE:CLASS")],
)
def test_a_mistake_is_told(tmp_path: Path, arguments: list[str], words: str) -> None:
    completed = call(tmp_path, *arguments)
    assert (completed.returncode, completed.stdout) == (2, "")
    assert words in completed.stderr.splitlines()[-1]


def test_an_interrupt_is_one_line_and_leaves_no_worker(tmp_path: Path) -> None:
    # A predictor that never answers, so that the interrupt comes in a run.
    (tmp_path / "mine.py").write_text(
        "import pathlib, sys, signal\n"
        + LAST.replace(
            "self.last = d",
            "if 'loky' in ' '.join(sys.orig_argv):\n"
            "            pathlib.Path('began').touch()\n"
            "            while True: signal.pause()\n"
            "        self.last = d",
        )
    )
    command = [*PROCESS, "mine:Last", "--jobs", "2"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        while process.poll() is None and not (tmp_path / "began").exists():
            time.sleep(0.02)
        workers = [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        printed, errors = process.communicate(timeout=120)
    assert (process.returncode, printed) == (130, "")
    assert errors.splitlines()[-1] == "formation score: interrupted"
    assert "Traceback" not in errors
    assert workers
    end = time.monotonic() + 60.0
    while any(map(alive, workers)):
        assert time.monotonic() < end, "a worker lives on"
        time.sleep(0.05)
