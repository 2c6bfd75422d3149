"""Python runs this at its start if this folder is in PYTHONPATH: each callback of a node waits for a random while.

Each process that delays callbacks leaves a file with its id in the folder SLOW_CALLBACKS.
"""

import os
import random
import time
from pathlib import Path

from robot_formation.nodes.host import signals

LONGEST_S = 0.05
_stop_on_signals = signals.stop_on_signals


def stop_on_signals():
    """What each node's process calls before it imports ROS."""
    _stop_on_signals()
    from robot_formation.nodes.host.component_node import Host

    delays = random.Random(os.getpid())
    heard = Host._heard

    def slowly_heard(node, handler):
        def slow(message):
            time.sleep(delays.uniform(0.0, LONGEST_S))
            handler(message)

        Path(os.environ["SLOW_CALLBACKS"], str(os.getpid())).touch()
        return heard(node, slow)

    Host._heard = slowly_heard


signals.stop_on_signals = stop_on_signals
