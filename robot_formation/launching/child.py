"""One node's process: started apart from the terminal, watched, and ended in good order."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable
from pathlib import Path

from robot_formation.experiment.run_result import NodeUsage
from robot_formation.launching.fork_server import ForkServer
from robot_formation.launching.outcome import manner
from robot_formation.launching.processes import Process

_LOG_LINE = re.compile(r"\[(?P<level>INFO|WARN|ERROR|FATAL)\] \[[\d.]+\] \[(?P<node>[^\]]+)\]: (?P<text>.*)")


class Child:
    """Starts a process of the table with its parameters in a file; output goes to a log in `folder`.

    Attributes:
        pid: the process id.
    """

    def __init__(self, process: Process, folder: Path, server: ForkServer, give_up: Callable[[], bool]) -> None:
        self.process = process
        self._log = folder / f"{process.stem}.log"
        parameters = process.write_parameters(folder)
        arguments = ["--ros-args", "-r", f"__ns:={process.namespace}", "--params-file", str(parameters)]
        self._log.touch()
        self.pid = server.start(process.executable, arguments, self._log, give_up)
        self.exit_code: int | None = None
        self.forced = False
        self.usage: NodeUsage | None = None

    @property
    def name(self) -> str:
        """The node's full name."""
        return self.process.name

    def poll(self) -> int | None:
        """Return the exit code (negative: the signal that killed it), None while it runs."""
        if self.exit_code is None:
            try:
                pid, status, used = os.wait4(self.pid, os.WNOHANG)
            except ChildProcessError:  # the process that forked it was killed before this one could adopt it
                return None if self.state else self._lost()
            if pid:
                self.exit_code = os.waitstatus_to_exitcode(status)
                self.usage = NodeUsage(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0)
        return self.exit_code

    def _lost(self) -> int:
        self.exit_code = -signal.SIGKILL
        return self.exit_code

    def signal(self, number: signal.Signals) -> None:
        """Send a signal if the process still runs; `forced` tells that it didn't end when it was asked to."""
        if self.poll() is None:
            self.forced = self.forced or number == signal.SIGKILL
            os.kill(self.pid, number)

    @property
    def state(self) -> str:
        """The state of its process as a letter: R, S, D, T (stopped), t (held by a debugger), Z; empty if gone."""
        try:
            stat = Path(f"/proc/{self.pid}/stat").read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""
        return stat.rpartition(")")[2].split()[0]

    @property
    def death(self) -> str:
        """Describe how it ended."""
        code = self.exit_code or 0
        how = manner(code)
        lines = self._text().strip().splitlines()
        match = _LOG_LINE.match(lines[-1]) if lines else None
        last = "" if match and match["level"] == "INFO" else self.last_words()  # that it was ready is no reason
        return f"{how}: {last}" if last else how

    def last_words(self) -> str:
        """Return the last line of its output."""
        lines = self._text().strip().splitlines()
        match = _LOG_LINE.match(lines[-1]) if lines else None
        return (match["text"] if match else lines[-1].strip()) if lines else ""

    def warnings(self) -> list[str]:
        """List what it warned of."""
        matches = (_LOG_LINE.match(line) for line in self._text().splitlines())
        return [f"{self.name}: {match['text']}" for match in matches if match and match["level"] != "INFO"]

    def _text(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")
