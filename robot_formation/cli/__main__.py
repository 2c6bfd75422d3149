"""The command line as a process: interrupts are quiet from here on, before anything that takes long is imported."""

from __future__ import annotations

import os
import sys

from robot_formation.cli.interrupts import Interrupts, guard_streams
from robot_formation.system.threads import one_thread


def main() -> int:
    """Run a verb; return the exit code of the process, 130 after an interrupt."""
    interrupts = Interrupts()
    try:
        interrupts.install()
        guard_streams()
        os.environ.update(one_thread(os.environ))
        from robot_formation.cli import main as command_line

        code = command_line.main()
    except SystemExit as leave:  # argparse
        interrupts.leave(leave.code if isinstance(leave.code, int) else 1)
        raise
    except (KeyboardInterrupt, Exception):
        # An interrupt that hits the import of compiled code may come out as any other exception.
        if not interrupts.came:
            raise
        print("formation: interrupted", file=sys.stderr)
        code = 130
    interrupts.leave(code)
    return code


if __name__ == "__main__":
    raise SystemExit(main())
