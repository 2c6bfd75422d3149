"""A slice of bench/fuzz_inputs.py: damaged and hostile input of every kind ends in a result or in one line."""

from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

import fuzz_cases
import fuzz_inputs

pytestmark = pytest.mark.slow

CASES = 200
FIRST = 1_000_000  # others than those that the script begins with


def options(*words: str) -> Namespace:
    # No bound on processor time: a loaded machine is not at fault.
    parsed: Namespace = fuzz_inputs.parsed(["--jobs", "1", "--cpu-s", "1e9", "--wall-s", "300", "--keep", "", *words])
    return parsed


@pytest.mark.long
def test_no_input_ends_in_a_traceback_or_takes_a_gigabyte() -> None:
    results = fuzz_inputs.run_all(options(), range(FIRST, FIRST + CASES))
    failures = [fuzz_inputs.report(result, 0) for result in results if result["wrong"]]
    assert not failures, "\n".join(failures)
    assert len(results) == CASES
    assert {result["kind"] for result in results} == set(fuzz_cases.KINDS)
    assert {result["code"] for result in results} >= {0, 2}
    lines = fuzz_inputs.table(results).splitlines()
    assert lines[-1].startswith(f"| all | {CASES} |")


def test_a_case_depends_on_seed_and_number_only(tmp_path: Path) -> None:
    made = []
    for place in (tmp_path / "one", tmp_path / "two"):
        for number in range(60):
            folder = place / str(number)
            folder.mkdir(parents=True)
            case = fuzz_cases.make_case(np.random.default_rng([0, number]), number, folder)
            files = {
                str(path.relative_to(folder)): path.read_bytes()
                for path in sorted(folder.rglob("*"))
                if path.is_file() and not path.is_symlink() and path.suffix != ".db3" and path.stat().st_size < 10**7
            }
            made.append((case.kind, [word.replace(str(folder), "") for word in case.arguments], files))
    assert made[:60] == made[60:]


@pytest.mark.parametrize(
    ("code", "out", "err", "wrong"),
    [
        (0, "{}", "", ""),
        (2, "", "formation info: bag doesn't exist\n", ""),
        (1, "", "", "exit code 1"),
        (2, "", "Traceback (most recent call last):\n", "a traceback is printed"),
        (2, "", "formation info: " + "x" * 5000, "a line of 5016 characters"),
        (2, "", "", "exit code 2 without a reason: []"),
        (0, '{"a": NaN}', "", "standard output is no strict JSON"),
    ],
)
def test_the_harness_finds_what_it_is_to_find(code: int, out: str, err: str, wrong: str) -> None:
    case = fuzz_cases.Case("bag", ["info", "bag", "--json"])
    assert fuzz_inputs.judged(case, code, out, err) == wrong


def test_tracebacks_hangs_and_deaths_are_failures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    folder.mkdir()
    monkeypatch.setattr(fuzz_inputs, "perform", lambda case: 1 // 0)
    assert "ZeroDivisionError" in fuzz_inputs.run_case(0, 1, folder)["wrong"]
    chosen = options("--wall-s", "0.001")
    (result,) = fuzz_inputs.run_all(chosen, [FIRST])
    assert "no end after 0.001 s" in result["wrong"]
