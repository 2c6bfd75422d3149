"""A recorder that dies, or whose disk is full, leaves a bag from which every finished chunk comes back."""

import os
import random
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dying_recorder import limit_file_size, ticks_in_finished_chunks, ticks_of
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recover import is_being_written, recover
from synthetic_bag import STORE

pytestmark = pytest.mark.slow

TICK = "std_msgs/msg/UInt32"
WRITER = """
import sys
from pathlib import Path
from robot_formation.bag.errors import BagError
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.message_recorder import Recorder
from robot_formation.bag.recording_queue import RecordingQueue
from robot_formation.bag.write_options import WriteOptions

split_bytes = int(sys.argv[2])
recorder = Recorder(Path(sys.argv[1]), {"seed": "3"}, WriteOptions(chunk_bytes=20000, split_bytes=split_bytes))
recorder.add_topic("/tick", "std_msgs/msg/UInt32", TopicQos(history="keep_all", depth=0))
queue = RecordingQueue(recorder)
finished = 0

def end_chunk():
    global finished
    recorder.end_chunk()
    finished = recorder.message_count
    print(finished, flush=True)

try:
    for number in range(10**9):
        queue.check()
        while queue.waiting_bytes > 10000:
            queue.check()
        queue.put("/tick", "std_msgs/msg/UInt32", bytes([0, 1, 0, 0]) + number.to_bytes(4, "little"), number)
        if number % 100 == 0:
            queue.call(end_chunk)
except BagError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
"""


def start(path: Path, split_bytes: int = 0, **options: Any) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", WRITER, str(path), str(split_bytes)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def line_of(process: subprocess.Popen[str]) -> str:
    """The next line that a recorder prints."""
    assert process.stdout is not None
    return process.stdout.readline()


def kill_and_recover(folder: Path, lines: int, split_bytes: int) -> None:
    """Kill a recorder after it has told so many ends of chunks; check what comes back."""
    process = start(folder / "run", split_bytes)
    for _ in range(lines):
        told = int(line_of(process))
    process.send_signal(signal.SIGKILL)
    process.communicate()
    check_recovery(folder, told)


def check_recovery(folder: Path, told: int) -> None:
    """Recover a dead recorder's bag: all messages of finished chunks come back, no fewer than it has told of."""
    partial = folder / "run.partial"
    expected = []
    for file in sorted(partial.glob("*.mcap"), key=lambda file: int(file.stem.rpartition("_")[2])):
        expected += ticks_in_finished_chunks(file)
    report = recover(partial, folder / "saved")
    assert report.messages == len(expected) >= told
    assert ticks_of(folder / "saved") == expected == list(range(len(expected)))
    with read_bag(folder / "saved") as bag:
        assert bag.metadata("robot_formation") == {"seed": "3"}


def moments(count: int, seed: int) -> list[int]:
    return random.Random(seed).sample(range(1, 120), count)


@pytest.mark.parametrize("lines", moments(3, seed=1))
def test_every_message_of_every_finished_chunk_survives_sigkill(tmp_path: Path, lines: int) -> None:
    kill_and_recover(tmp_path, lines, split_bytes=0)


def test_so_do_those_of_a_split_bag(tmp_path: Path) -> None:
    kill_and_recover(tmp_path, 100, split_bytes=20_000)


@pytest.mark.parametrize("split_bytes", [0, 50_000])
def test_sigkill_at_any_of_ten_moments(tmp_path: Path, split_bytes: int) -> None:
    """A recorder is stopped instead and its files are copied: they are what a kill at this moment would leave."""
    process = start(tmp_path / "run", split_bytes)
    told, before = 0, 0
    try:
        for lines in sorted(moments(10, seed=2 + split_bytes)):
            process.send_signal(signal.SIGCONT)
            for _ in range(lines - before):
                told = int(line_of(process))
            process.send_signal(signal.SIGSTOP)
            os.waitid(os.P_PID, process.pid, os.WSTOPPED)
            folder = tmp_path / f"after_{lines}"
            shutil.copytree(tmp_path / "run.partial", folder / "run.partial")
            check_recovery(folder, told)
            before = lines
    finally:
        process.kill()
        process.communicate()


def test_a_split_bag_whose_last_file_is_still_empty_is_recovered(tmp_path: Path) -> None:
    process = start(tmp_path / "run", 20_000)
    for _ in range(40):
        told = int(line_of(process))
    process.kill()
    process.communicate()
    files = list((tmp_path / "run.partial").glob("*.mcap"))
    assert len(files) > 1
    (tmp_path / "run.partial" / f"run_{len(files)}.mcap").touch()
    check_recovery(tmp_path, told)


def test_a_bag_that_is_being_written_is_known_from_one_whose_writer_is_dead(tmp_path: Path) -> None:
    process = start(tmp_path / "run")
    line_of(process)
    assert is_being_written(tmp_path / "run.partial")
    process.kill()
    process.communicate()
    assert not is_being_written(tmp_path / "run.partial")


def test_a_full_disk_is_told_in_one_line_and_leaves_a_bag_to_be_recovered(tmp_path: Path) -> None:
    process = start(tmp_path / "run", preexec_fn=limit_file_size)
    told, error = process.communicate(timeout=60)
    assert process.returncode == 2
    partial = tmp_path / "run.partial"
    assert error.strip().splitlines()[-1].endswith(f"('formation recover {partial}' saves what was written)")
    assert "File too large" in error
    assert "Traceback" not in error
    assert not (tmp_path / "run").exists()
    report = recover(partial, tmp_path / "saved")
    assert report.messages >= int(told.split()[-1]) > 0
    assert ticks_of(tmp_path / "saved") == list(range(report.messages))


def test_a_disk_that_is_full_during_recovery_leaves_the_old_bag_alone(tmp_path: Path) -> None:
    process = start(tmp_path / "run")
    for _ in range(100):
        line_of(process)
    process.kill()
    process.communicate()
    code = (
        "import resource, sys; from robot_formation.cli.main import main; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000)); sys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", code, "recover", str(tmp_path / "run.partial")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    (line,) = result.stderr.strip().splitlines()
    assert line.endswith("can't write the bag: File too large; free space or choose another path")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.partial"]
    assert Path(tmp_path / "run.partial" / "run_0.mcap").stat().st_size > 2000


def test_the_oracle_of_these_tests_counts_what_was_written(tmp_path: Path) -> None:
    from robot_formation.bag.qos import TopicQos
    from robot_formation.bag.writer import BagWriter

    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/tick", TICK, TopicQos())
        for number in range(7):
            tick = STORE.types[TICK](number)
            writer.write("/tick", bytes(STORE.serialize_cdr(tick, TICK)), number)
    assert ticks_in_finished_chunks(tmp_path / "run" / "run_0.mcap") == list(range(7))
