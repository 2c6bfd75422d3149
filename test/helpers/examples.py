"""Installs packages of examples/ as their users do."""

import shutil
import subprocess
import sys
from pathlib import Path

from repository import ROOT


def install_example(name: str, target: Path, source: Path) -> None:
    """Install an example by pip.

    Args:
        name: its folder in examples/.
        target: where it is installed; to be put into PYTHONPATH.
        source: an empty folder, in which it is built.
    """
    copy = source / name
    shutil.copytree(ROOT / "examples" / name, copy, ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
    options = ("--quiet", "--no-deps", "--no-build-isolation", "--disable-pip-version-check", "--target", str(target))
    subprocess.run([sys.executable, "-m", "pip", "install", *options, str(copy)], check=True, timeout=300)
