"""The command line as a person gets it wrong."""

from pathlib import Path

import pytest

from robot_formation.cli.main import main


def complaint(capsys: pytest.CaptureFixture[str], *arguments: Path | str) -> str:
    """Call a verb that must fail on its arguments; return the one line that it prints."""
    code: object
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as leave:  # argparse ends so
        code = leave.code
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    lines = captured.err.strip().splitlines()
    assert "Traceback" not in captured.err
    return lines[-1]
