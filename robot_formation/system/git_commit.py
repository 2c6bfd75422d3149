"""The commit of the checkout that the package runs from."""

from __future__ import annotations

import subprocess

from robot_formation.paths import project_root


def git_commit(digits: int = 40) -> str:
    """Return the checkout's commit, with `-dirty` behind it if files have been changed; empty without one."""
    root = project_root()
    if root is None:
        return ""
    command = ["git", "-C", str(root), "describe", "--always", f"--abbrev={digits}", "--exclude=*", "--dirty"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10.0).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
