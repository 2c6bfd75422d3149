"""The pool of worker processes: order, errors, and what its processes inherit."""

import os
import subprocess
import sys

import pytest

from robot_formation.batch.pool import run_parallel

pytestmark = pytest.mark.slow

# In a process of its own: loky's resource tracker starts with a process's first pool.
SCRIPT = """
import os
from pathlib import Path
from joblib.externals.loky.backend.resource_tracker import _resource_tracker
from robot_formation.batch.pool import run_parallel
assert list(run_parallel(abs, [(-1,), (-2,)], 2)) == [1, 2]
print(set(run_parallel(os.getenv, [("OPENCV_FOR_THREADS_NUM",)] * 2, 2)))
print("PYTHONWARNINGS" in os.environ or "OPENCV_FOR_THREADS_NUM" in os.environ)
print(b"ignore:resource_tracker:UserWarning" in Path(f"/proc/{_resource_tracker._pid}/environ").read_bytes())
"""


def test_results_come_in_order_in_this_process_and_in_others() -> None:
    for jobs in (1, 2):
        assert list(run_parallel(divmod, [(7, 2), (9, 4), (1, 3)], jobs)) == [(3, 1), (2, 1), (0, 1)]


def test_what_the_function_raises_comes_through() -> None:
    with pytest.raises(ZeroDivisionError):
        list(run_parallel(divmod, [(7, 2), (9, 0)], 2))


def test_workers_use_one_thread_their_tracker_prints_no_warnings_and_this_process_is_as_before() -> None:
    removed = ("PYTHONWARNINGS", "OPENCV_FOR_THREADS_NUM")
    environment = {name: value for name, value in os.environ.items() if name not in removed}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["{'1'}", "False", "True"]
