"""`formation completion`: what it prints lets real shells complete."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cli_tools import complaint
from repository import ROOT
from robot_formation.cli.completion import SHELLS
from robot_formation.cli.main import main
from robot_formation.cli.verbs import VERBS

NAMES = {verb.__name__.rpartition(".")[2].rstrip("_") for verb in VERBS}
BASH = """\
eval "$(formation completion bash)"
COMP_LINE=$1 COMP_POINT=${#1} COMP_TYPE=9
eval "$(complete -p formation | sed 's/.*-F \\([^ ]*\\) .*/\\1/') formation"
printf '%s\\n' "${COMPREPLY[@]}"
"""
FISH = """\
formation completion fish | source
complete --do-complete $argv[1]
"""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Variables of a shell that has `formation` on its PATH, and nothing in its folder but two files."""
    command = tmp_path / "bin" / "formation"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m robot_formation.cli "$@"\n')
    command.chmod(0o755)
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "first.csv").write_text("")
    (tmp_path / "here" / "second.csv").write_text("")
    path = os.pathsep.join([str(command.parent), os.environ["PATH"]])
    return {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "HOME": str(tmp_path)}


def completed(shell: list[str], line: str, environment: dict[str, str]) -> set[str]:
    """What a shell offers at the end of a line."""
    if shutil.which(shell[0]) is None:
        pytest.skip(f"{shell[0]} is not installed")
    folder = Path(environment["HOME"]) / "here"
    done = subprocess.run([*shell, line], cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {offer.split("\t")[0].strip() for offer in done.stdout.splitlines() if offer.strip()}


CASES = [
    ("formation ", NAMES),
    ("formation re", {"record", "recover", "replay", "report"}),
    ("formation run --tr", {"--track"}),
    ("formation run --track one --se", {"--seed", "--set"}),
    ("formation calibrate ", {"motors", "encoders", "vision"}),
    ("formation calibrate motors --re", {"--reference-noise", "--repeats"}),
    ("formation analyze --format ", {"png", "svg", "pdf"}),
    ("formation completion ", set(SHELLS)),
    ("formation run --surface pl", {"plane"}),
    ("formation run --scenario line_of_f", {"line_of_five"}),
    ("formation run --scenario fir", {"first.csv"}),
    ("formation run --schedule t", {"turns", "together", "timer"}),
    ("formation run --without block", {"block_detector"}),
    ("formation sweep --paths circle,cl", {"circle,clothoid"}),
    ("formation predict f", {"first.csv"}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("line", "offered"), CASES)
def test_bash_completes_verbs_options_values_and_files(
    line: str, offered: set[str], environment: dict[str, str]
) -> None:
    assert completed(["bash", "-c", BASH, "bash"], line, environment) == offered


@pytest.mark.slow
@pytest.mark.parametrize(("line", "offered"), CASES[:4])
def test_fish_completes_them_too(line: str, offered: set[str], environment: dict[str, str]) -> None:
    assert completed(["fish", "--no-config", "-c", FISH], line, environment) == offered


@pytest.mark.slow
def test_zsh_takes_what_is_printed_for_it(environment: dict[str, str]) -> None:
    code = 'autoload -Uz compinit && compinit -u; eval "$(formation completion zsh)"; print -- ${_comps[formation]}; :'
    assert completed(["zsh", "-f", "-c", code], "", environment) == {"_python_argcomplete"}


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_gets_code_that_names_the_command(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert "formation" in capsys.readouterr().out


def test_another_shell_is_refused_with_those_that_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    line = complaint(capsys, "completion", "cmd")
    assert all(shell in line for shell in SHELLS)


def test_nothing_is_imported_for_completion_where_no_shell_asks() -> None:
    code = (
        "import sys; from robot_formation.cli.main import main; main(['list', 'tracks', '--json']); "
        "sys.exit('argcomplete' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.DEVNULL, check=True)
