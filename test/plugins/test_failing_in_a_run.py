"""A class from outside the package that fails in the middle of a run: what was recorded until then is analysed."""

import json
import os
import subprocess
import sys
from pathlib import Path

from repository import ROOT

FAILING = """
log = open("log.txt", "w")
class Failing:
    def __init__(self):
        self.count = 0
        self.own = open("own.txt", "w")
    def observe(self, displacement):
        self.count += 1
        print(self.count, file=log)
        print(self.count, file=self.own)
    def forecast(self):
        return [0.0, 0.05 / (3 - self.count)]
"""
REASON = "predictor 'mine:Failing': forecast failed: ZeroDivisionError: float division by zero"


def run(folder: Path, name: str, *options: str) -> tuple[str, dict[str, object]]:
    """Return the run's standard error and JSON."""
    words = ["run", "--predictor", "mine:Failing", "--camera", "on_demand", "--set", "leader.timesteps=6"]
    command = [sys.executable, "-m", "robot_formation.cli", *words, *options, "--bag", str(folder / name), "--json"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 4, done.stderr
    return done.stderr, json.loads(done.stdout)


def test_the_run_ends_as_if_its_node_had_died_in_process_and_over_the_graph(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(FAILING)
    said, found = run(tmp_path, "process", "--in-process")
    assert said.splitlines()[-1] == f"formation run: {REASON}"
    assert (found["outcome"], found["reason"]) == ("incomplete", REASON)
    assert isinstance(found["timesteps"], list)
    assert len(found["timesteps"]) == 3
    logs = [tmp_path / name for name in ("log.txt", "own.txt")]  # never closed
    for log in logs:
        assert log.read_text().split() == ["1", "2", "3"]
        log.unlink()
    graph_said, graph_found = run(tmp_path, "graph")
    for log in logs:
        assert log.read_text().split() == ["1", "2", "3"]
    assert graph_found["timesteps"] == found["timesteps"]
    assert REASON in str(graph_found["reason"])
    assert graph_said.count("ZeroDivisionError") == 1, graph_said
    for text in (said, graph_said):
        assert "Traceback" not in text
        assert "warning" not in text
