"""bench/: every script has a line in its README, and the table of comparisons is what the benches say."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import all as all_benches
import graph_memory
from comparison import Comparison, as_json, from_json, markdown
from repository import ROOT

BENCH = ROOT / "bench"
SCRIPTS = sorted(path.name for path in BENCH.glob("*.py"))


def test_the_readme_names_every_script_and_no_other() -> None:
    named = set(re.findall(r"`(\w+\.py)`", (BENCH / "README.md").read_text()))
    assert named | {"all.py"} == set(SCRIPTS)


@pytest.mark.parametrize("name", all_benches.BENCHES)
def test_a_bench_that_is_compared_prints_its_comparisons(name: str) -> None:
    assert "add_comparisons(parser)" in (BENCH / f"{name}.py").read_text()


def test_ratios_above_one_are_better() -> None:
    assert Comparison("time", 1.0, 2.0, "s").ratio == 2.0
    assert Comparison("rate", 1.0, 2.0, "per s", larger_is_better=True).ratio == 0.5


def test_comparisons_survive_the_way_between_processes() -> None:
    found = [Comparison("a", 1.5, 3.0, "ms", "peer"), Comparison("b", 2.0, 4.0, "", larger_is_better=True)]
    assert from_json(as_json(found)) == found
    assert markdown([("x", found[0])])[-1] == "| `x` | a | 1.5 ms | peer: 3 ms | 2.00 |"


@pytest.mark.parametrize("text", ["", "[1]", '[{"what": "a"}]', "{"])
def test_what_is_no_comparison_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="no comparisons"):
        from_json(text)


@pytest.mark.long
def test_one_bench_through_the_command(tmp_path: Path) -> None:
    command = [sys.executable, "bench/all.py", "--quick", "--only", "growth", "--out", str(tmp_path / "table.md")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "| `growth` | bag of 40 timesteps |" in (tmp_path / "table.md").read_text()


def test_a_misspelt_bench_is_named() -> None:
    command = [sys.executable, "bench/all.py", "--only", "detectr"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "no bench 'detectr'" in done.stderr


def test_memory_is_that_of_all_descendants_and_a_process_that_has_ended_has_none() -> None:
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert child.pid in graph_memory.descendants(os.getpid())
    child.communicate(b"\n")
    assert list(graph_memory.descendants(child.pid)) == []


def test_a_thread_that_ends_while_its_children_are_read_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def ended(*arguments: object, **options: object) -> str:
        raise ProcessLookupError

    monkeypatch.setattr(Path, "read_text", ended)
    assert list(graph_memory.descendants(os.getpid())) == []
