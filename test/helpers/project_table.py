"""What pyproject.toml and setup.py hand to setuptools."""

import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

import setuptools

from repository import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pytest brings it


@cache
def project() -> dict[str, Any]:
    """The table [project]."""
    table: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return table


@cache
def setup_arguments() -> dict[str, Any]:
    """The keyword arguments of setup.py."""
    found = {}
    before, old = setuptools.setup, Path.cwd()
    setuptools.setup = lambda **arguments: found.update(arguments)
    os.chdir(ROOT)
    try:
        exec(compile((ROOT / "setup.py").read_text(), "setup.py", "exec"), {"__name__": "__main__"})
    finally:
        setuptools.setup = before
        os.chdir(old)
    return found


def installed_files() -> dict[str, str]:
    """Files beside the code: where each is installed, below the prefix, and where it lies here."""
    return {f"{place}/{Path(file).name}": file for place, files in setup_arguments()["data_files"] for file in files}
