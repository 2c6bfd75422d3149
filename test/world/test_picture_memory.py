"""Blocks as large as pictures are reused instead of being asked for anew."""

import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource, sys
import numpy as np
from robot_formation.world.picture_memory import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for round in range(101):
    if round == 1:
        before = faults()
    blocks = [np.ones(600_000, np.uint8) for _ in range(6)]
    del blocks
print(faults() - before)
"""


def faults(how: str) -> int:
    done = subprocess.run([sys.executable, "-c", FAULTS, how], capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries are not changed")
def test_freed_pictures_are_kept() -> None:
    assert faults("kept") < 1_000
    assert faults("given back") > 10_000
