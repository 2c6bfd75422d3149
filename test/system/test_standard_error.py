"""What goes to standard error's descriptor can be diverted, also where the descriptor is closed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robot_formation.system.standard_error import diverted_stderr, silent_stderr


def test_what_is_printed_below_python_goes_into_the_file_and_then_to_the_terminal_again(
    capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "printed"
    with path.open("w") as file, diverted_stderr(file):
        os.write(2, b"inside")
    os.write(2, b"behind")
    assert path.read_text() == "inside"
    assert capfd.readouterr().err == "behind"


def test_nothing_comes_out_of_silence_and_an_error_ends_it(capfd: pytest.CaptureFixture[str]) -> None:
    try:
        with silent_stderr():
            os.write(2, b"inside")
            raise ValueError
    except ValueError:
        os.write(2, b"behind")
    assert capfd.readouterr().err == "behind"


def test_a_closed_descriptor_stays_closed() -> None:
    code = "from robot_formation.system.standard_error import silent_stderr as s\nwith s(): pass\nimport os\n"
    code += "try:\n    os.fstat(2)\nexcept OSError:\n    print('closed')\n"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, stdout=subprocess.PIPE, preexec_fn=lambda: os.close(2), text=True, check=True)
    assert done.stdout.strip() == "closed"
