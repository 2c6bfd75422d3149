"""`formation test`: what pytest is told."""

import importlib.util
import itertools
import subprocess
from typing import Any

import pytest

from robot_formation.cli.main import main


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Commands that would be run."""
    found: list[list[str]] = []

    class Process:
        def __init__(self, command: list[str], **_options: Any) -> None:
            found.append(command)

        def __enter__(self) -> "Process":
            return self

        def __exit__(self, *_error: object) -> None:
            pass

        def wait(self) -> int:
            return 5

    monkeypatch.setattr(subprocess, "Popen", Process)
    return found


@pytest.mark.parametrize(
    ("arguments", "chosen"),
    [
        ([], ["not long"]),
        (["--all"], []),
        (["--quick"], ["not graph and not slow and not long"]),
        (["--", "-x"], ["not long"]),
        (["--", "-m", "graph"], ["not long", "graph"]),  # pytest takes the last
        (["--", "test/graph/test_barrier.py"], []),
        (["--", "test/cli/test_run.py::test_a"], []),
    ],
)
def test_long_tests_are_run_if_asked_for(commands: list[list[str]], arguments: list[str], chosen: list[str]) -> None:
    assert main(["test", *arguments]) == 5
    (command,) = commands
    pytest_arguments = command[command.index("pytest") + 1 :]
    given = [after for before, after in itertools.pairwise(pytest_arguments) if before == "-m"]
    assert given == chosen


def test_each_test_has_ten_minutes_if_pytest_timeout_is_installed(
    commands: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.util.find_spec
    for there in (True, False):

        def found(name: str, package: str | None = None, there: bool = there) -> object:
            return (object() if there else None) if name == "pytest_timeout" else find(name, package)

        monkeypatch.setattr(importlib.util, "find_spec", found)
        assert main(["test"]) == 5
        assert ("--timeout=600" in commands.pop()) is there


def test_quick_and_all_exclude_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leave:
        main(["test", "--quick", "--all"])
    assert leave.value.code == 2
    assert "--all" in capsys.readouterr().err
