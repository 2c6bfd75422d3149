"""The checkout's files as git has them, without what was built or run in it, and the archives built of them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from repository import ROOT


def source_files() -> list[str]:
    """The files of the source, tracked or not yet; skips the test outside of a git checkout."""
    listed = subprocess.run(["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, capture_output=True)
    if listed.returncode != 0:
        pytest.skip("not a git checkout: which files are source is not known")
    names = filter(None, listed.stdout.decode().split("\0"))
    return [name for name in names if (ROOT / name).is_file()]  # a removed file may still be in the index


def copy_source(folder: Path) -> Path:
    """Copy the source into a folder; links become files."""
    for name in source_files():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target)
    return folder


def build_archive(kind: str, source: Path, folder: Path) -> Path:
    """Build an archive (sdist or wheel) by the setuptools of this environment, as pip does; return its path."""
    code = f"from setuptools import build_meta; print(build_meta.build_{kind}({str(folder)!r}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / done.stdout.splitlines()[-1]
