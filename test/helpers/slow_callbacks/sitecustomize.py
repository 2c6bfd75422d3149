"""Python runs this at its start if this folder is in PYTHONPATH: each callback of a node waits for a random while.

Each process that delays callbacks leaves a file with its id in the folder SLOW_CALLBACKS.
"""

import os
import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robot_formation.nodes.host import signals

LONGEST_S = 0.02
_stop_on_signals = signals.stop_on_signals


def stop_on_signals() -> None:
    """What each node's process calls before it imports ROS."""
    _stop_on_signals()
    from robot_formation.nodes.host.component_node import Host

    delays = random.Random(os.getpid())
    heard = Host._heard

    def slowly_heard(node: Host, handler: Callable[[Any], None]) -> Callable[[Any], None]:
        def slow(message: Any) -> None:
            time.sleep(delays.uniform(0.0, LONGEST_S))
            handler(message)

        Path(os.environ["SLOW_CALLBACKS"], str(os.getpid())).touch()
        return heard(node, slow)

    Host._heard = slowly_heard  # type: ignore[assignment, method-assign]


signals.stop_on_signals = stop_on_signals
